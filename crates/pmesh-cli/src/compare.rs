//! `pmesh compare`: one model as every stream: size, first picture, decoding time, error of what the first bytes give.

use crate::encode::gzip;
use crate::error::{CliError, Result};
use crate::{input, output};
use clap::builder::RangedU64ValueParser;
use pmesh_build::import::Model;
use pmesh_build::measure::deviation;
use pmesh_build::pipeline::{BuildOptions, Method, Steps, build};
use pmesh_build::simplify::{BatchOptions, ForestOptions, PatchOptions, collapse_batches, collapse_forests, remove_patches};
use pmesh_codec::pmesh::{EncodeOptions, LevelStream, quantise};
use pmesh_codec::text::{self, TextOptions};
use pmesh_codec::{Arrival, Receiver, compact, patch, slod, split};
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Compare all streams on given models: bytes, first picture, decoding time, error after 5, 15 and 30 kB
///
/// Positions only, on the same grid. The error is the two-sided root mean square distance to the finest level of what a client
/// holds then, in 1/10000 of the bounding box's diagonal, by 100,000 points a side.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  pmesh compare horse.off\n  pmesh compare *.obj --bits 14")]
pub struct Args {
    /// Meshes (OBJ, PLY, STL, OFF, glTF, GLB)
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Bits a coordinate, 8 to 16
    #[arg(long, default_value_t = 12, value_parser = RangedU64ValueParser::<u8>::new().range(8..=16))]
    bits: u8,
    /// Keep the streams, each as NAME.ENDING in this folder
    #[arg(long)]
    keep: Option<PathBuf>,
}

/// Points a side of the error measurement.
const SAMPLES: usize = 100_000;
/// Bytes after which the error is measured (FC01's Figure 2).
const CHECKPOINTS: [usize; 3] = [5_000, 15_000, 30_000];

pub fn run(args: &Args) -> Result<()> {
    output::say(
        "model              stream       bytes  bits/vertex   levels  first picture at  decode ms    error at 5 kB    15 kB    30 kB",
    )?;
    if let Some(folder) = &args.keep {
        std::fs::create_dir_all(folder).map_err(CliError::io(folder))?;
    }
    for path in &args.inputs {
        let mut model = input::model(path, &input::read(path)?)?;
        model.mesh.vertices.attributes = Default::default();
        model.texture = None;
        model.mesh = quantise(&model.mesh, Some(args.bits));
        for (name, bytes) in streams(path, &model, args.bits)? {
            output::say(&row(path, name, &bytes, &model.mesh)?)?;
            if let Some(folder) = &args.keep {
                let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                output::write_bytes(&folder.join(format!("{stem}.{name}")), &bytes)?;
            }
        }
    }
    Ok(())
}

/// The model as each stream.
fn streams(path: &Path, model: &Model, bits: u8) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let failed = || CliError::encode(path);
    let default = build(model, &BuildOptions::default(), |_| ()).map_err(CliError::build(path))?;
    let smooth = BuildOptions { method: Method::Closest, steps: Steps::Single, ..Default::default() };
    let smooth = build(model, &smooth, |_| ()).map_err(CliError::build(path))?;
    let mut out = ["pmesh", "lod.gz", "slod", "pits", "pfs", "prefix"].map(|name| (name, Vec::new())).to_vec();
    pmesh_codec::pmesh::encode(&default, EncodeOptions { position_bits: Some(bits) }, &mut out[0].1).map_err(failed())?;
    let mut plain = Vec::new();
    text::write(&mesh_of(&default)?, TextOptions::default(), &mut plain).map_err(failed())?;
    out[1].1 = gzip(&plain).map_err(CliError::io(path))?;
    slod::encode(&mesh_of(&smooth)?, &mut out[2].1).map_err(failed())?;
    let patches = remove_patches(&model.mesh, PatchOptions::default(), |_| ());
    patch::encode(&patches, Some(bits), &mut out[3].1).map_err(failed())?;
    let forests = collapse_forests(&model.mesh, ForestOptions::default(), |_| ());
    split::encode(&forests, Some(bits), &mut out[4].1).map_err(failed())?;
    // A .pmesh by --profile prefix.
    let collapses = collapse_batches(&model.mesh, BatchOptions::default(), |_| ());
    compact::encode(&collapses, Some(bits), &mut out[5].1).map_err(failed())?;
    Ok(out)
}

fn mesh_of(stream: &LevelStream) -> Result<ProgressiveMultilevelMesh> {
    let mut mesh = ProgressiveMultilevelMesh::new(stream.attribute_set);
    stream.levels.iter().try_for_each(|l| mesh.add_level(l).map(drop))?;
    Ok(mesh)
}

fn row(path: &Path, name: &str, bytes: &[u8], finest: &IndexedMesh) -> Result<String> {
    let failed = |source| CliError::Decode { path: path.into(), source };
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let mut receiver = Receiver::default();
        // Time is what is shown here.
        #[allow(clippy::disallowed_methods)]
        let start = Instant::now();
        receiver.push(bytes).and_then(|()| receiver.finish()).map_err(failed)?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    let mut receiver = Receiver::default();
    let (mut first, mut levels, mut errors) = (None, 0, Vec::new());
    let mut checkpoints = CHECKPOINTS.iter().peekable();
    for chunk in bytes.chunks(100) {
        receiver.push(chunk).map_err(failed)?;
        while let Some(arrival) = receiver.poll() {
            levels += u32::from(matches!(arrival, Arrival::Level { .. }));
        }
        let mesh = receiver.mesh();
        if first.is_none() && mesh.arrived_levels() > 0 && mesh.triangle_count(mesh.finest_level())? > 0 {
            first = Some(receiver.bytes());
        }
        while checkpoints.next_if(|&&c| receiver.bytes() >= c as u64).is_some() {
            errors.push(error(&receiver, finest));
        }
    }
    // A stream that ends before a checkpoint is exact there.
    errors.resize(CHECKPOINTS.len(), Some(0.0));
    let shown = |e: &Option<f64>| e.map_or("-".into(), |e| format!("{:.1}", e * 1e4));
    Ok(format!(
        "{:<18} {name:<7} {:>10} {:>12.2} {levels:>8} {:>17} {:>10.1} {:>16} {:>8} {:>8}",
        path.file_stem().unwrap_or_default().to_string_lossy(),
        bytes.len(),
        8.0 * bytes.len() as f64 / finest.vertices.len() as f64,
        first.map_or("-".into(), |b| b.to_string()),
        best * 1e3,
        shown(&errors[0]),
        shown(&errors[1]),
        shown(&errors[2]),
    ))
}

/// Deviation of the finest level that has arrived; `None` if it has no triangle.
fn error(receiver: &Receiver, finest: &IndexedMesh) -> Option<f64> {
    let mesh = receiver.mesh();
    let coarse = mesh.mesh_at(mesh.finest_level().into()).ok().filter(|m| !m.triangles.is_empty())?;
    Some(deviation(finest, &coarse, SAMPLES).rms)
}
