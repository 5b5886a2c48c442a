//! `.pmesh` as a hierarchy in blocks, for views.

use super::{Bits, DEFAULT_BITS, How};
use crate::error::{CliError, Result};
use crate::output::{self, say};
use crate::progress::Progress;
use pmesh_build::import::Model;
use pmesh_view::write_file;
use std::path::Path;

/// Takes `model` apart and writes it.
pub(super) fn write(model: &Model, input: &Path, path: &Path, how: &How, quiet: bool) -> Result<()> {
    let given = [how.levels.is_some(), how.growth.is_some(), how.simplifier.is_some(), how.base.is_some()];
    if given.contains(&true) {
        eprintln!("warning: --levels, --growth, --simplifier and --base have no effect with --profile views");
    }
    let set = model.mesh.vertices.set();
    let left_out = [
        (set.normals, "normals"),
        (set.colors, "colours"),
        (set.texcoords, "texture coordinates"),
        (model.texture.is_some(), "the image"),
    ];
    let names: Vec<_> = left_out.iter().filter(|n| n.0).map(|n| n.1).collect();
    if !names.is_empty() {
        eprintln!("warning: {}: {} are not carried: a file for views holds positions only", input.display(), names.join(", "));
    }
    let bits = how.bits.unwrap_or(Bits(Some(DEFAULT_BITS))).0;
    let progress = Progress::new("removing vertices", quiet);
    let views = pmesh_server::model_of(&model.mesh, bits, |part| progress.set(part))
        .map_err(|e| CliError::Other(format!("{}: {e}", input.display())))?;
    progress.done();
    let (bytes, spent) = write_file(&views).map_err(|e| CliError::Other(format!("{}: {e}", input.display())))?;
    output::write_bytes(path, &bytes)?;
    if quiet {
        return Ok(());
    }
    let h = views.hierarchy();
    let splits = (h.nodes().len() as u32 - h.root_count()) / 2;
    let each = |bits: f64| bits / 8.0 / f64::from(splits.max(1));
    say(&format!(
        "{}: {} triangles, {} base vertices, {splits} splits, {} bytes; of each split {:.2} bytes say where, {:.2} how it cuts, {:.2} its bounds",
        path.display(),
        model.mesh.triangles.len(),
        h.root_count(),
        bytes.len(),
        each(spent.positions),
        each(spent.cuts),
        each(spent.bounds)
    ))
}
