//! A mesh to the collapses that the compact stream undoes: what `pmesh encode` does unless `--profile fast` is asked for.

use crate::BuildError;
use crate::simplify::{BatchOptions, collapse_batches};
use pmesh_codec::compact::CompactStream;
use pmesh_codec::pmesh::quantise;
use pmesh_core::IndexedMesh;

/// Fewest vertices of a base that keeps the first picture waiting: some 60 kB.
const LARGE_BASE: usize = 20_000;

/// Takes `mesh` apart as the grid of `bits` has it. The stream has `mesh` as it was given, and no image. `progress` gets the part done, 0 to 1.
/// O(n log n). Errors: no vertices.
pub fn take_apart(
    mesh: IndexedMesh,
    bits: Option<u8>,
    options: BatchOptions,
    mut progress: impl FnMut(f64),
) -> Result<CompactStream, BuildError> {
    if mesh.vertices.is_empty() {
        return Err(BuildError::Empty);
    }
    let total = mesh.vertices.len();
    let all = (total - options.base_vertices.min(total)).max(1) as f64;
    let taken = collapse_batches(&quantise(&mesh, bits), options, |left| progress((total - left) as f64 / all));
    Ok(CompactStream { mesh, ..taken })
}

/// False if much of a large model comes with the first level: then it hardly sharpens, and refining what is not manifold, as version 0 does, is worth
/// more than few bytes.
pub fn is_worth_it(stream: &CompactStream) -> bool {
    let total = stream.mesh.vertices.len();
    let base = total - stream.levels.iter().map(Vec::len).sum::<usize>();
    base < LARGE_BASE || base < total / 4
}
