//! `.pmesh` in its compact profiles.

use super::{Bits, DEFAULT_BITS, How};
use crate::error::{CliError, Result};
use crate::output::{self, say};
use crate::progress::Progress;
use pmesh_build::BuildError;
use pmesh_build::import::Model;
use pmesh_build::simplify::{BatchOptions, collapse_batches};
use pmesh_codec::compact;
use pmesh_codec::pmesh::quantise;
use std::path::Path;

/// Takes `model` apart and writes it.
pub(super) fn write(model: Model, input: &Path, path: &Path, how: &How, quiet: bool) -> Result<()> {
    if how.levels.is_some() || how.growth.is_some() || how.simplifier.is_some() {
        eprintln!("warning: --levels, --growth and --simplifier are for --profile fast: they have no effect here");
    }
    let bits = how.bits.unwrap_or(Bits(Some(DEFAULT_BITS))).0;
    if model.mesh.vertices.is_empty() {
        return Err(CliError::build(input)(BuildError::Empty));
    }
    // What the grid has rounded is what is taken apart.
    let mesh = quantise(&model.mesh, bits);
    let default = BatchOptions::default();
    let options = BatchOptions {
        base_vertices: how.base.map_or(default.base_vertices, |t| t / 2),
        profile: how.compact().unwrap_or_default(),
    };
    let total = mesh.vertices.len();
    let progress = Progress::new("removing vertices", quiet);
    let all = (total - options.base_vertices.min(total)).max(1) as f64;
    let mut stream = collapse_batches(&mesh, options, |left| progress.set((total - left) as f64 / all));
    progress.done();
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
    if report.base.0 as usize > 2 * options.base_vertices {
        line += "; what is not manifold stays in the base, and a few vertices a piece";
    }
    say(&line)
}
