//! Encode, decode, level selection, memory and simplification error on real meshes.
//!
//! `cargo bench -p pmesh-build -- [--quality] [FILE…]`; without files, the samples, and the meshes that lie in
//! ../shared/models beside the project. Times are wall-clock seconds of one run: compare within it.
#![allow(missing_docs)]
// Times are what this is for.
#![allow(clippy::disallowed_methods)]

use pmesh_build::import::{Model, import};
use pmesh_build::measure::deviation;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::sample::{SAMPLES, sample};
use pmesh_build::simplify::{Placement, SimplifyOptions, simplify};
use pmesh_codec::Receiver;
use pmesh_codec::pmesh::{EncodeOptions, encode};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Points a side of the error measurement, as in the figures that ours are compared with.
const SAMPLES_A_SIDE: usize = 200_000;

fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let out = f();
    (out, start.elapsed().as_secs_f64())
}

fn row(name: &str, model: &Model) -> Result<(), Box<dyn std::error::Error>> {
    let triangles = model.mesh.triangles.len() as f64;
    let vertices = model.mesh.vertices.len();
    let (bytes, encode_secs) = timed(|| -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        let stream = build(model, &BuildOptions::default(), |_| ())?;
        let mut bytes = Vec::new();
        encode(&stream, EncodeOptions { position_bits: Some(12) }, &mut bytes)?;
        Ok(bytes)
    });
    let bytes = bytes?;
    let mut receiver = Receiver::default();
    let (decoded, decode_secs) = timed(|| receiver.push(&bytes).and_then(|()| receiver.finish()));
    decoded?;
    let mesh = receiver.into_mesh();
    let middle = mesh.level_count() / 2;
    let (_, fine_secs) = timed(|| mesh.triangles_at(0).map(|t| t.len()));
    let (_, middle_secs) = timed(|| mesh.triangles_at(middle).map(|t| t.len()));
    let plain = (model.mesh.vertices.memory_bytes()).min(vertices * 64) + model.mesh.triangles.len() * 12;
    let attributes = mesh.memory_bytes() as f64 / plain as f64;
    println!(
        "{name:<14} {vertices:>8} {triangles:>9} {:>10} {:>6.2} {:>8.2} {:>8.2} {:>8.2} {:>8.2} {:>6.3}",
        bytes.len(),
        bytes.len() as f64 * 8.0 / vertices as f64,
        triangles / encode_secs / 1e6,
        triangles / decode_secs / 1e6,
        fine_secs * 1e3,
        middle_secs * 1e3,
        attributes
    );
    Ok(())
}

fn quality(name: &str, model: &Model) -> Result<(), Box<dyn std::error::Error>> {
    for placement in [Placement::Kept, Placement::Optimal] {
        let options = SimplifyOptions { target_triangles: 10, placement };
        let (collapses, secs) = timed(|| simplify(&model.mesh, options, |_| ()));
        let collapses = collapses?;
        print!("{name:<14} {:<8} {secs:>6.2} s", if placement == Placement::Kept { "kept" } else { "optimal" });
        for part in [0.1, 0.01, 0.001] {
            let target = (model.mesh.triangles.len() as f64 * part) as usize;
            let coarse = collapses.mesh_at(&model.mesh, target);
            let d = deviation(&model.mesh, &coarse, SAMPLES_A_SIDE);
            print!("   {:>8.2} /{:>8.1}", d.rms * 1e4, d.max * 1e4);
        }
        println!();
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let measure_quality = arguments.iter().any(|a| a == "--quality");
    let mut files: Vec<PathBuf> = arguments.iter().filter(|a| !a.starts_with("--")).map(PathBuf::from).collect();
    let mut models: Vec<(String, Model)> = Vec::new();
    if files.is_empty() {
        models.extend(SAMPLES.iter().filter_map(|(name, _)| Some((name.to_string(), sample(name)?))));
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
        files.extend(std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()));
        files.retain(|f| f.extension().is_some_and(|e| e != "md"));
        files.sort();
    }
    if measure_quality {
        println!(
            "{:<14} {:<8} {:>8}   RMS / maximum error, 1e-4 of the diagonal, at 10 %, 1 % and 0.1 % of the triangles",
            "mesh", "vertices", "time"
        );
    } else {
        println!(
            "{:<14} {:>8} {:>9} {:>10} {:>6} {:>8} {:>8} {:>8} {:>8} {:>6}",
            "mesh", "vertices", "triangles", "bytes", "bpv", "enc MT/s", "dec MT/s", "fine ms", "mid ms", "memory"
        );
    }
    for file in files {
        let name = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let model = import(&file.to_string_lossy(), &std::fs::read(&file)?, &mut |_| None)?;
        models.push((name, model));
        // One at a time: a million triangles each adds up.
        let (name, model) = models.pop().unwrap_or_default();
        if measure_quality { quality(&name, &model)? } else { row(&name, &model)? }
    }
    for (name, model) in &models {
        if measure_quality { quality(name, model)? } else { row(name, model)? }
    }
    Ok(())
}
