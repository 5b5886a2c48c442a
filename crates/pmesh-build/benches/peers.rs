//! Our streams beside other people's: what `cargo xtask bench peers` runs of ours.
//!
//! `cargo bench -p pmesh-build --bench peers -- FOLDER FILE…` prepares each mesh as all coders get it (positions only; equal
//! positions are one vertex, vertices of no triangle are left out, and triangles that are then degenerate), writes it to FOLDER
//! as plain numbers (NAME.raw: vertex and triangle count, floats, indices), writes our streams beside it, and prints a line each:
//! name, stream, bits, bytes, seconds to encode, seconds to decode. After a file, `--raw` stops at NAME.raw, and `--curve BYTES`
//! measures instead: our error after parts of so many bytes and in between, then that of each mesh in FOLDER/NAME.lod.
#![allow(missing_docs)]
// Times are what this is for.
#![allow(clippy::disallowed_methods)]

use pmesh_build::compact::take_apart;
use pmesh_build::compare::difference;
use pmesh_build::import::{Model, import};
use pmesh_build::measure::deviation;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::simplify::{BatchOptions, Profile};
use pmesh_codec::Receiver;
use pmesh_codec::compact;
use pmesh_codec::pmesh::{self, EncodeOptions, quantise};
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Points a side of the error measurement.
const SAMPLES_A_SIDE: usize = 200_000;
/// Parts of the reference's bytes at which the error is measured.
const PARTS: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.7];
/// Points of a curve between the first picture and the whole.
const POINTS: usize = 24;

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let out = f();
    (out, start.elapsed().as_secs_f64())
}

fn prepared(mesh: &IndexedMesh) -> IndexedMesh {
    let (mut place, mut positions) = (HashMap::new(), Vec::new());
    let mut number = |v: u32| {
        let p = mesh.vertices.positions[v as usize];
        *place.entry(p.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
            positions.push(p);
            positions.len() as u32 - 1
        })
    };
    let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(&mut number)).collect();
    triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let mut out = IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() };
    // Vertices that only degenerate triangles used.
    let mut kept = vec![u32::MAX; out.vertices.len()];
    let mut positions = Vec::new();
    for v in out.triangles.iter_mut().flatten() {
        let k = &mut kept[*v as usize];
        if *k == u32::MAX {
            *k = positions.len() as u32;
            positions.push(out.vertices.positions[*v as usize]);
        }
        *v = *k;
    }
    out.vertices.positions = positions;
    out
}

fn raw(mesh: &IndexedMesh) -> Vec<u8> {
    let mut out: Vec<u8> = [mesh.vertices.len(), mesh.triangles.len()].iter().flat_map(|&n| (n as u32).to_le_bytes()).collect();
    out.extend(mesh.vertices.positions.iter().flatten().flat_map(|x| x.to_le_bytes()));
    out.extend(mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()));
    out
}

fn from_raw(bytes: &[u8]) -> Option<IndexedMesh> {
    let words: Vec<[u8; 4]> = bytes.chunks_exact(4).filter_map(|w| w.try_into().ok()).collect();
    let (counts, rest) = words.split_at_checked(2)?;
    let (positions, corners) = rest.split_at_checked(3 * u32::from_le_bytes(counts[0]) as usize)?;
    let positions = positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(f32::from_le_bytes)).collect();
    let triangles = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(u32::from_le_bytes)).collect();
    Some(IndexedMesh { vertices: Vertices { positions, ..Default::default() }, triangles, ..Default::default() })
}

fn compact(mesh: &IndexedMesh, bits: u8, profile: Profile) -> Outcome<Vec<u8>> {
    let options = BatchOptions { profile, ..Default::default() };
    let mut bytes = Vec::new();
    compact::encode(&take_apart(mesh.clone(), Some(bits), options, |_| ())?, Some(bits), &mut bytes)?;
    Ok(bytes)
}

fn decode(bytes: &[u8]) -> Outcome<Receiver> {
    let mut receiver = Receiver::default();
    receiver.push(bytes)?;
    receiver.finish()?;
    Ok(receiver)
}

fn run(name: &str, mesh: &IndexedMesh, folder: &Path) -> Outcome<()> {
    std::fs::write(folder.join(format!("{name}.raw")), raw(mesh))?;
    let line = |stream: &str, bits: u8, encoder: &dyn Fn() -> Outcome<Vec<u8>>| -> Outcome<()> {
        let (bytes, encode_secs) = timed(encoder);
        let bytes = bytes?;
        let (receiver, decode_secs) = timed(|| decode(&bytes));
        if let Some(what) = difference(&receiver?.mesh().finest_mesh(), &quantise(mesh, Some(bits))) {
            return Err(format!("{name}, {stream}: {what}").into());
        }
        println!("{name}\t{stream}\t{bits}\t{}\t{encode_secs:.4}\t{decode_secs:.4}", bytes.len());
        std::fs::write(folder.join(format!("{name}.{stream}.{bits}.pmesh")), bytes)?;
        Ok(())
    };
    for bits in [12, 10, 11, 14, 16] {
        line("prefix", bits, &|| compact(mesh, bits, Profile::Prefix))?;
    }
    line("size", 12, &|| compact(mesh, 12, Profile::Size))?;
    line("fast", 12, &|| {
        let model = Model { mesh: mesh.clone(), ..Default::default() };
        let mut bytes = Vec::new();
        pmesh::encode(&build(&model, &BuildOptions::default(), |_| ())?, EncodeOptions { position_bits: Some(12) }, &mut bytes)?;
        Ok(bytes)
    })
}

fn report(name: &str, what: &str, bytes: usize, mesh: &IndexedMesh, whole: &IndexedMesh) {
    let d = deviation(whole, mesh, SAMPLES_A_SIDE);
    println!("{name}\t{what}\t{bytes}\t{}\t{:.3}\t{:.2}", mesh.triangles.len(), d.rms * 1e4, d.max * 1e4);
}

/// Error of what a client shows after parts of `reference` bytes, after others, and of the meshes that could have been sent instead.
fn curve(name: &str, mesh: &IndexedMesh, reference: f64, folder: &Path) -> Outcome<()> {
    let whole = quantise(mesh, Some(12));
    let bytes = compact(mesh, 12, Profile::Prefix)?;
    let shown = |at: usize| -> Outcome<IndexedMesh> {
        let mut receiver = Receiver::default();
        receiver.push(&bytes[..at.min(bytes.len())])?;
        Ok(receiver.newest_mesh())
    };
    for part in PARTS {
        let at = (reference * part) as usize;
        report(name, &format!("{part}"), at, &shown(at)?, &whole);
    }
    let first = decode(&bytes)?.info().and_then(|i| i.levels.as_ref()?.first().map(|l| l.end_byte)).unwrap_or(1) as f64;
    for i in 0..=POINTS {
        let at = (first * (bytes.len() as f64 / first).powf(i as f64 / POINTS as f64)).round() as usize;
        report(name, "ours", at, &shown(at)?, &whole);
    }
    for i in 0.. {
        let Ok(bytes) = std::fs::read(folder.join(format!("{name}.lod/{i}.raw"))) else { break };
        report(name, &format!("lod {i}"), 0, &from_raw(&bytes).ok_or("a mesh that is cut off")?, &whole);
    }
    Ok(())
}

fn main() -> Outcome<()> {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench").peekable();
    let folder = PathBuf::from(args.next().ok_or("a folder to write to is missing")?);
    while let Some(path) = args.next() {
        let bytes = std::fs::read(&path).map_err(|e| format!("{path}: {e}"))?;
        let mesh = prepared(&import(&path, &bytes, &mut |_| None)?.mesh);
        let name = Path::new(&path).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if args.next_if(|a| a == "--curve").is_some() {
            curve(&name, &mesh, args.next().ok_or("--curve needs a number")?.parse()?, &folder)?;
        } else if args.next_if(|a| a == "--raw").is_some() {
            std::fs::write(folder.join(format!("{name}.raw")), raw(&mesh))?;
        } else {
            run(&name, &mesh, &folder)?;
        }
    }
    Ok(())
}
