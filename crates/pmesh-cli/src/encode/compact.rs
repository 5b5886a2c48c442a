//! `.pmesh` in its compact profiles.

use super::{Bits, DEFAULT_BITS, How};
use crate::error::{CliError, Result};
use crate::output::{self, say};
use crate::progress::Progress;
use pmesh_build::BuildError;
use pmesh_build::import::Model;
use pmesh_build::simplify::{BatchOptions, Profile, collapse_batches};
use pmesh_codec::compact::{self, CompactStream};
use pmesh_codec::pmesh::quantise;
use std::path::Path;

/// Fewest vertices of a base that keeps the first picture waiting: some 60 kB.
const LARGE_BASE: usize = 20_000;

/// Takes `model` apart. The stream has the rounded mesh and no image.
pub(super) fn take_apart(model: &Model, profile: Profile, input: &Path, how: &How, quiet: bool) -> Result<CompactStream> {
    if how.levels.is_some() || how.growth.is_some() || how.simplifier.is_some() {
        eprintln!("warning: --levels, --growth and --simplifier are for --profile fast: they have no effect here");
    }
    if model.mesh.vertices.is_empty() {
        return Err(CliError::build(input)(BuildError::Empty));
    }
    // What the grid has rounded is what is taken apart.
    let mesh = quantise(&model.mesh, bits(how));
    let options = BatchOptions { base_vertices: base_vertices(how), profile };
    let total = mesh.vertices.len();
    let progress = Progress::new("removing vertices", quiet);
    let all = (total - options.base_vertices.min(total)).max(1) as f64;
    let stream = collapse_batches(&mesh, options, |left| progress.set((total - left) as f64 / all));
    progress.done();
    Ok(stream)
}

fn bits(how: &How) -> Option<u8> {
    how.bits.unwrap_or(Bits(Some(DEFAULT_BITS))).0
}
fn base_vertices(how: &How) -> usize {
    how.base.map_or(BatchOptions::default().base_vertices, |t| t / 2)
}

/// False if much of a large model comes with the first level: then it hardly sharpens.
pub(super) fn is_worth_it(stream: &CompactStream) -> bool {
    let total = stream.mesh.vertices.len();
    let base = total - stream.levels.iter().map(Vec::len).sum::<usize>();
    base < LARGE_BASE || base < total / 4
}

/// Writes `model`, taken apart.
pub(super) fn write(mut stream: CompactStream, model: Model, path: &Path, how: &How, quiet: bool) -> Result<()> {
    let (bits, total) = (bits(how), model.mesh.vertices.len());
    stream.mesh = model.mesh;
    stream.texture = model.texture;
    let mut out = Vec::new();
    let report = compact::encode(&stream, bits, &mut out).map_err(CliError::encode(path))?;
    output::write_bytes(path, &out)?;
    if quiet {
        return Ok(());
    }
    let each = |bits: f64| bits / f64::from(report.removed.0.max(1));
    let spent = report.spent;
    let mut line = format!(
        "{}: {} levels, {} triangles, {} bytes ({:.2} bits a vertex); base {} vertices in {} bytes; then {:.2} bits a vertex to say which split, {:.2} how, {:.2} where",
        path.display(),
        stream.levels.len() + 1 + usize::from(report.loose.0 > 0),
        stream.mesh.triangles.len(),
        out.len(),
        out.len() as f64 * 8.0 / total as f64,
        report.base.0,
        report.base.2,
        each(spent.flags),
        each(spent.ways),
        each(spent.places),
    );
    if spent.attributes > 0.0 {
        line += &format!(", {:.2} for attributes", each(spent.attributes));
    }
    if report.base.0 as usize > 2 * base_vertices(how) {
        line += "; what is not manifold stays in the base, and a few vertices a piece";
    }
    say(&line)
}
