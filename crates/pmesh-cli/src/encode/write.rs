//! Levels, as the stream that a name asks for.

use super::{Bits, DEFAULT_BITS, How, Stream};
use crate::error::{CliError, Result};
use crate::output;
use flate2::{Compression, write::GzEncoder};
use pmesh_codec::pmesh::{EncodeOptions, LevelStream, quantise};
use pmesh_codec::slod;
use pmesh_codec::text::{self, TextOptions, TextVariant};
use pmesh_core::{Attributes, ProgressiveMultilevelMesh};
use std::io::Write;
use std::path::Path;

/// Writes `stream` in the format that `path` names.
pub fn write_stream(stream: LevelStream, path: &Path, how: &How, quiet: bool) -> Result<()> {
    let kind = Stream::of(path, how)?;
    if how.surface_partition && kind != Stream::Lod {
        eprintln!("warning: --surface-partition is for the text format; it has no effect here");
    }
    let mut bytes = Vec::new();
    let shown = (stream.levels.len(), stream.levels.iter().map(|l| l.triangles.len()).sum::<usize>());
    match kind {
        Stream::Pmesh => {
            let options = EncodeOptions { position_bits: how.bits.unwrap_or(Bits(Some(DEFAULT_BITS))).0 };
            pmesh_codec::pmesh::encode(&stream, options, &mut bytes).map_err(CliError::encode(path))?;
        }
        Stream::Lod => {
            let variant = if how.surface_partition { TextVariant::SurfacePartition } else { TextVariant::Interleaved };
            let mesh = positions_only(stream, path, how)?;
            text::write(&mesh, TextOptions { dimension: None, variant }, &mut bytes).map_err(CliError::encode(path))?;
            if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz")) {
                bytes = gzip(&bytes).map_err(CliError::io(path))?;
            }
        }
        Stream::Patch | Stream::Split | Stream::Nodes => {
            let message = "has levels already: write it as a .pmesh and encode that";
            return Err(CliError::Usage(format!("{}: what it is made of {message}", path.display())));
        }
        Stream::Slod => {
            let mesh = positions_only(stream, path, how)?;
            let report = slod::encode(&mesh, &mut bytes).map_err(CliError::encode(path))?;
            if report.points > 0 {
                eprintln!(
                    "warning: {}: {} triangles that are a single vertex are left out: a .slod cannot hold them",
                    path.display(),
                    report.points
                );
            }
        }
    }
    output::write_bytes(path, &bytes)?;
    if quiet {
        return Ok(());
    }
    output::say(&format!("{}: {} levels, {} triangles, {} bytes", path.display(), shown.0, shown.1, bytes.len()))
}

pub fn gzip(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

pub(super) fn warn_of_positions_only(path: &Path) {
    eprintln!(
        "warning: {}: this format holds positions only; normals, colours and textures are left out (write a .pmesh to keep them)",
        path.display()
    );
}

/// For formats that hold positions only: attributes are dropped with a warning, positions quantised if asked for.
fn positions_only(mut stream: LevelStream, path: &Path, how: &How) -> Result<ProgressiveMultilevelMesh> {
    if stream.attribute_set != Default::default() || stream.texture.is_some() {
        warn_of_positions_only(path);
    }
    let mut all = pmesh_core::IndexedMesh::default();
    for level in &mut stream.levels {
        level.vertices.attributes = Attributes::default();
        level.moved.values.attributes = Attributes::default();
        all.vertices.extend_from(&level.vertices);
    }
    let on_grid = quantise(&all, how.bits.unwrap_or(Bits(None)).0).vertices.positions;
    let mut next = on_grid.into_iter();
    let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
    for level in &mut stream.levels {
        level.vertices.positions.iter_mut().zip(&mut next).for_each(|(p, q)| *p = q);
        mesh.add_level(level)?;
    }
    Ok(mesh)
}
