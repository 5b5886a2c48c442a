//! Encode, decode, level selection, memory and simplification error on real meshes.
//!
//! `cargo bench -p pmesh-build -- [--quality | --verify | --steps | --local] [FILE…]`; without files, the samples, and the meshes that lie in
//! ../shared/models beside the project. Times are wall-clock seconds of one run: compare within it.
#![allow(missing_docs)]
// Times are what this is for.
#![allow(clippy::disallowed_methods)]

use pmesh_build::compare::difference;
use pmesh_build::import::{Model, import};
use pmesh_build::measure::deviation;
use pmesh_build::pipeline::{BuildOptions, Method, Steps, build};
use pmesh_build::rule::{Replay, replay};
use pmesh_build::sample::{SAMPLES, sample};
use pmesh_build::simplify::{
    BatchOptions, ForestOptions, PatchOptions, Placement, Profile, SimplifyOptions, collapse_batches, collapse_forests,
    remove_patches, simplify,
};
use pmesh_codec::compact::{self, CompactStream};
use pmesh_codec::pmesh::{EncodeOptions, encode, quantise};
use pmesh_codec::scene::{self, Encoding};
use pmesh_codec::{Receiver, patch, slod, split};
use pmesh_core::local::{ConstraintGraph, LocalMesh, Refiner};
use pmesh_core::stepped::SteppedLevel;
use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Points a side of the error measurement, as in the figures that ours are compared with.
const SAMPLES_A_SIDE: usize = 200_000;

type Outcome = Result<(), Box<dyn std::error::Error>>;

fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let out = f();
    (out, start.elapsed().as_secs_f64())
}

fn row(name: &str, model: &Model) -> Outcome {
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
    let mut mesh = receiver.into_mesh();
    mesh.shrink_to_fit();
    let middle = mesh.level_count() / 2;
    let (_, fine_secs) = timed(|| mesh.triangles_at(0).map(|t| t.len()));
    let (_, middle_secs) = timed(|| mesh.triangles_at(middle).map(|t| t.len()));
    let mut plain_vertices = model.mesh.vertices.clone();
    plain_vertices.shrink_to_fit();
    let plain = plain_vertices.memory_bytes() + model.mesh.triangles.len() * 12;
    let memory = mesh.memory_bytes() as f64 / plain as f64;
    println!(
        "{name:<14} {vertices:>8} {triangles:>9} {:>10} {:>6.2} {:>8.2} {:>8.2} {:>8.2} {:>8.2} {:>6.3}",
        bytes.len(),
        bytes.len() as f64 * 8.0 / vertices as f64,
        triangles / encode_secs / 1e6,
        triangles / decode_secs / 1e6,
        fine_secs * 1e3,
        middle_secs * 1e3,
        memory
    );
    Ok(())
}

fn quality(name: &str, model: &Model) -> Outcome {
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

/// Every stream of a model: every level and 1000 prefixes are valid, and what decodes last is the input (F.1).
fn verify(name: &str, model: &Model) -> Outcome {
    for bits in [Some(12), None] {
        let shown = bits.map_or("exact floats".to_string(), |b| format!("{b} bits"));
        let mesh = quantise(&model.mesh, bits);
        let mut bytes = Vec::new();
        encode(&build(model, &BuildOptions::default(), |_| ())?, EncodeOptions { position_bits: bits }, &mut bytes)?;
        verify_stream(name, &format!("pmesh {shown}"), &bytes, &mesh)?;
        // Positions are taken apart as the grid has them; attributes have grids of their own.
        let mut taken = mesh.clone();
        taken.vertices.attributes = model.mesh.vertices.attributes.clone();
        let patches = remove_patches(&taken, PatchOptions::default(), |_| ());
        bytes.clear();
        patch::encode(&patches, bits, &mut bytes)?;
        verify_stream(name, &format!("pits {shown}"), &bytes, &mesh)?;
        for profile in [Profile::Prefix, Profile::Size] {
            let collapses = collapse_batches(&taken, BatchOptions { profile, ..Default::default() }, |_| ());
            bytes.clear();
            compact::encode(&CompactStream { mesh: model.mesh.clone(), ..collapses }, bits, &mut bytes)?;
            verify_stream(name, &format!("{profile:?} {shown}"), &bytes, &mesh)?;
        }
        let forests = collapse_forests(&taken, ForestOptions::default(), |_| ());
        bytes.clear();
        let report = split::encode(&forests, bits, &mut bytes)?;
        verify_stream(name, &format!("pfs {shown}"), &bytes, &mesh)?;
        let raw = report.raw_bits_per_triangle();
        println!("{name:<14} pfs: {raw:.2} bits a new triangle before entropy coding");
        if raw > 3.5 {
            return Err(format!("{name}: doubling may cost 3.5 bits a new triangle (A.31), not {raw:.2}").into());
        }
        if bits.is_none() {
            bytes.clear();
            let rounded = scene::write(&patches, Encoding::X3dXml, &mut bytes)?;
            // A sum has no negative zero.
            let mut expected = without_seams(&model.mesh);
            expected.vertices.positions.iter_mut().flatten().for_each(|x| *x += 0.0);
            expected.vertices.attributes.normals.iter_mut().flatten().for_each(|x| *x += 0.0);
            expected.vertices.attributes.texcoords.iter_mut().flatten().for_each(|x| *x += 0.0);
            if rounded > 0 {
                println!(
                    "{name:<14} x3d: {rounded} numbers are too small beside their neighbours to come back exactly: not compared"
                );
            } else {
                verify_stream(name, "x3d", &bytes, &expected)?;
            }
        }
    }
    let mut plain = Model { mesh: model.mesh.clone(), ..Default::default() };
    plain.mesh.vertices.attributes = Default::default();
    let options = BuildOptions { method: Method::Closest, steps: Steps::Single, ..Default::default() };
    let mut mesh = ProgressiveMultilevelMesh::new(Default::default());
    build(&plain, &options, |_| ())?.levels.iter().try_for_each(|l| mesh.add_level(l).map(drop))?;
    let mut bytes = Vec::new();
    slod::encode(&mesh, &mut bytes)?;
    verify_stream(name, "slod", &bytes, &without_seams(&plain.mesh))
}

fn without_seams(mesh: &IndexedMesh) -> IndexedMesh {
    IndexedMesh { position_of: Vec::new(), ..mesh.clone() }
}

/// Most levels of a stream that are looked at.
const LEVELS_LOOKED_AT: u32 = 64;

fn verify_stream(name: &str, shown: &str, bytes: &[u8], expected: &IndexedMesh) -> Outcome {
    let mut receiver = Receiver::default();
    let (mut at, mut levels, mut looked) = (0, 0, 0);
    for cut in random_cuts(bytes.len()) {
        // What a decoder holds does not depend on how its bytes were cut: this is what the prefix alone gives.
        receiver.push(&bytes[at..cut])?;
        at = cut;
        let mesh = receiver.mesh();
        if mesh.arrived_levels() > levels {
            levels = mesh.arrived_levels();
            mesh.check_invariants();
            if looked < LEVELS_LOOKED_AT {
                looked += 1;
                mesh.mesh_at(mesh.finest_level().into())?.check()?;
            }
        }
    }
    receiver.push(&bytes[at..])?;
    receiver.finish()?;
    let mesh = receiver.mesh();
    let count = mesh.level_count();
    for level in (0..count).step_by((count / LEVELS_LOOKED_AT).max(1) as usize) {
        mesh.mesh_at(level.into())?.check()?;
        if mesh.triangles_at(level) != pmesh_core::reference::triangles_at(mesh, level) {
            return Err(format!("{name}: {shown}: level {level} differs from the reference").into());
        }
    }
    if let Some(difference) = difference(&mesh.finest_mesh(), expected) {
        return Err(format!("{name}: {shown}: {difference}").into());
    }
    println!(
        "{name:<14} {shown:<18} {count:>7} levels valid, 1000 prefixes valid, the last level is the input, {} bytes",
        bytes.len()
    );
    Ok(())
}

/// Smooth levels of detail: what building, coding and stepping cost. Stepping costs what changes (B.11).
fn steps(name: &str, model: &Model) -> Outcome {
    let options = BuildOptions { method: Method::Closest, steps: Steps::Single, ..Default::default() };
    let (stream, build_s) = timed(|| build(model, &options, |_| ()));
    let mut mesh = ProgressiveMultilevelMesh::new(model.mesh.vertices.set());
    stream?.levels.iter().try_for_each(|l| mesh.add_level(l).map(drop))?;
    let mut bytes = Vec::new();
    let (report, encode_s) = timed(|| slod::encode(&mesh, &mut bytes));
    let mut receiver = Receiver::default();
    let (pushed, decode_s) = timed(|| receiver.push(&bytes));
    pushed?;
    let (n, t) = (mesh.level_count(), f64::from(report?.triangles) / 1e6);
    print!(
        "{name:<14} {n:>8} vertices  cluster {build_s:.2} s  encode {:.2} MT/s  decode {:.2} MT/s ",
        t / encode_s,
        t / decode_s
    );
    let mut stepped = SteppedLevel::default();
    stepped.set_level(&mesh, n / 2)?;
    for part in [0.01, 0.1, 1.0] {
        let half = (f64::from(n) * part / 2.0) as u32;
        let (low, high) = ((n / 2).saturating_sub(half), (n / 2 + half).min(n - 1));
        stepped.set_level(&mesh, high)?;
        let (touched, finer_s) = timed(|| stepped.set_level(&mesh, low));
        let (_, coarser_s) = timed(|| stepped.set_level(&mesh, high));
        let (_, fresh_s) = timed(|| mesh.triangles_at(low));
        let (finer, coarser, fresh) = (finer_s * 1e3, coarser_s * 1e3, fresh_s * 1e3);
        print!(
            " | {:.0} %: finer {finer:.3} ms ({} corners), coarser {coarser:.3}, by path compression {fresh:.3}",
            part * 100.0,
            touched?
        );
    }
    println!();
    Ok(())
}

/// Of each collapse a sphere around it and all that it requires, and the longest edge of all these: (middle, radius, length).
fn spheres(mesh: &IndexedMesh, r: &Replay) -> Vec<([f32; 3], f32, f32)> {
    let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f32>().sqrt();
    let mut out: Vec<([f32; 3], f32, f32)> = Vec::with_capacity(r.collapses.len());
    for c in &r.collapses {
        let [blue, red] = [c.blue, c.red].map(|v| mesh.vertices.positions[v as usize]);
        let (mut radius, mut length) = (0.0f32, distance(blue, red));
        for &j in &c.requires {
            let (middle, inner, edge) = out[j as usize];
            (radius, length) = (radius.max(distance(blue, middle) + inner), length.max(edge));
        }
        out.push((blue, radius, length));
    }
    out
}

/// Views of a walk through the model.
const VIEWS: usize = 60;

/// Local refinement (D.13): a walk through the model, each view followed until nothing is left to do.
fn local(name: &str, model: &Model) -> Outcome {
    let mesh = &model.mesh;
    let options = SimplifyOptions { target_triangles: 60, placement: Placement::Kept };
    let pairs = simplify(mesh, options, |_| ())?.pairs;
    let (r, replay_s) = timed(|| replay(mesh, &pairs));
    let r = r?;
    let spheres = spheres(mesh, &r);
    let graph = ConstraintGraph::new(r.collapses.iter().map(|c| &c.requires[..]))?;
    let each = |pairs: usize| pairs as f64 / r.collapses.len().max(1) as f64;
    let required = each(r.collapses.iter().map(|c| c.requires.len()).sum());
    let mut local = LocalMesh::new(mesh.vertices.len() as u32, &mesh.triangles, &pairs, graph)?;
    let direct = each((0..local.graph().len()).map(|i| local.graph().requires(i).len()).sum());
    let (low, high) = mesh.bounds();
    let mut refiner = Refiner::new(&local, |_| 0.0);
    let (mut steps, mut refine_s, mut refresh_s, mut shown) = (0u32, 0.0, 0.0, 0);
    for view in 0..VIEWS {
        let t = view as f32 / (VIEWS - 1) as f32;
        let eye: [f32; 3] = std::array::from_fn(|k| low[k] + t * (high[k] - low[k]));
        // Longest edge by distance: about an angle.
        let error = |i: u32| {
            let (middle, radius, length) = spheres[i as usize];
            let d = (0..3).map(|k| (middle[k] - eye[k]) * (middle[k] - eye[k])).sum::<f32>().sqrt();
            length / (d - radius).max(1e-6 * length)
        };
        refresh_s += timed(|| refiner.refresh(&local, error)).1;
        let (work, seconds) = timed(|| refiner.refine(&mut local, error, 0.02, u32::MAX));
        let work = work?;
        (steps, refine_s) = (steps + work.splits + work.collapses, refine_s + seconds);
        shown = shown.max(local.shown().len());
    }
    println!(
        "{name:<14} {:>8} collapses, {required:.1} required by each, {direct:.1} of them directly, replayed in {replay_s:.2} s | {VIEWS} views: {steps} steps, {:.2} M a second; weighing anew {:.1} ms a view; at most {shown} triangles",
        r.collapses.len(),
        f64::from(steps) / refine_s / 1e6,
        1e3 * refresh_s / VIEWS as f64,
    );
    Ok(())
}

fn random_cuts(length: usize) -> Vec<usize> {
    let mut state = 0x2545_f491u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % length
    };
    let mut cuts: Vec<usize> = (0..1000).map(|_| next()).collect();
    cuts.sort_unstable();
    cuts
}

fn main() -> Outcome {
    let (flags, files): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|a| a.starts_with("--"));
    let has = |flag: &str| flags.iter().any(|f| f == flag);
    let run = if has("--steps") {
        println!(
            "smooth levels (SS97): clustering, .slod both ways, and a step of 1, 10 and 100 % of the vertices by either way"
        );
        steps
    } else if has("--quality") {
        println!("mesh, placement, seconds; RMS / maximum error, 1e-4 of the diagonal, at 10 %, 1 % and 0.1 % of the triangles");
        quality
    } else if has("--verify") {
        verify
    } else if has("--local") {
        println!("local refinement (D.13): collapses undone and done along a walk through the model");
        local
    } else {
        println!(
            "{:<14} {:>8} {:>9} {:>10} {:>6} {:>8} {:>8} {:>8} {:>8} {:>6}",
            "mesh", "vertices", "triangles", "bytes", "bpv", "enc MT/s", "dec MT/s", "fine ms", "mid ms", "memory"
        );
        row
    };
    let mut files: Vec<PathBuf> = files.into_iter().map(PathBuf::from).collect();
    if files.is_empty() {
        for (name, _) in SAMPLES {
            sample(name).map_or(Ok(()), |model| run(name, &model))?;
        }
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/models");
        files.extend(std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()));
        files.retain(|f| f.extension().is_some_and(|e| e != "md"));
        files.sort();
    }
    for file in files {
        let name = file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        run(&name, &import(&file.to_string_lossy(), &bytes, &mut |_| None)?)?;
    }
    Ok(())
}
