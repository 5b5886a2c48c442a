//! `.pmesh` in its compact profiles.

use super::{Bits, DEFAULT_BITS, How};
use crate::error::{CliError, Result};
use crate::output::{self, say};
use crate::progress::Progress;
use pmesh_build::compact;
use pmesh_build::import::Model;
use pmesh_build::simplify::{BatchOptions, Profile};
use pmesh_codec::compact::{CompactStream, encode};
use std::path::Path;

/// Takes `model` apart; gives it back if that is not worth it and no profile was asked for.
pub(super) fn take_apart(
    model: Model,
    profile: Profile,
    input: &Path,
    how: &How,
    quiet: bool,
) -> Result<std::result::Result<CompactStream, Model>> {
    if how.levels.is_some() || how.growth.is_some() || how.simplifier.is_some() {
        eprintln!("warning: --levels, --growth and --simplifier are for --profile fast: they have no effect here");
    }
    let options = BatchOptions { base_vertices: base_vertices(how), profile };
    let progress = Progress::new("removing vertices", quiet);
    let stream =
        compact::take_apart(model.mesh, bits(how), options, |part| progress.set(part)).map_err(CliError::build(input))?;
    progress.done();
    if how.profile.is_some() || compact::is_worth_it(&stream) {
        return Ok(Ok(CompactStream { texture: model.texture, ..stream }));
    }
    if !quiet {
        eprintln!("note: {}: much of it is not manifold, so it is written with --profile fast", input.display());
    }
    Ok(Err(Model { mesh: stream.mesh, ..model }))
}

fn bits(how: &How) -> Option<u8> {
    how.bits.unwrap_or(Bits(Some(DEFAULT_BITS))).0
}
fn base_vertices(how: &How) -> usize {
    how.base.map_or(BatchOptions::default().base_vertices, |t| t / 2)
}

/// Writes a model that is taken apart.
pub(super) fn write(stream: &CompactStream, path: &Path, how: &How, quiet: bool) -> Result<()> {
    let (bits, total) = (bits(how), stream.mesh.vertices.len());
    let mut out = Vec::new();
    let report = encode(stream, bits, &mut out).map_err(CliError::encode(path))?;
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
        each(spent.places + spent.sharper),
    );
    if spent.attributes > 0.0 {
        line += &format!(", {:.2} for attributes", each(spent.attributes));
    }
    if report.base.0 as usize > 2 * base_vertices(how) {
        line += "; what is not manifold stays in the base, and a few vertices a piece";
    }
    say(&line)
}
