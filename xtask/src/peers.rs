//! `cargo xtask bench peers`: our streams beside Draco, meshoptimizer and plain numbers, in one run on one machine.

use crate::plot::{Curve, bar_plot, log_plot};
use crate::shell::{Result, heading, output_of, program, root};
use crate::{build, tools};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What the others are measured against.
const REFERENCE: &str = "draco cl10";
/// Columns of the table at 12 bits.
const CODERS: [&str; 8] =
    [REFERENCE, "draco cl7", "meshopt + brotli", "plain + brotli", "plain + gzip", "prefix", "size", "fast"];
/// Mbit/s.
const LINKS: [f64; 9] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0];
const OTHER_BITS: [u32; 4] = [10, 11, 14, 16];

/// A coder's figures for a mesh.
#[derive(Clone, Copy, Default)]
struct Figures {
    bytes: f64,
    encode_secs: Option<f64>,
    decode_secs: Option<f64>,
}

/// Meshes of a run, each by coder and bits.
type Table = BTreeMap<String, BTreeMap<(String, u32), Figures>>;

/// Runs both benchmarks and prints Markdown; `csv` gets every line; plots go to target/peers.
pub fn run(meshes: &[PathBuf], csv: Option<&Path>) -> Result<()> {
    let meshes = if meshes.is_empty() { shared_models()? } else { meshes.to_vec() };
    let absolute = |m: &PathBuf| std::path::absolute(m).map_err(|e| format!("{}: {e}", m.display()));
    let meshes = meshes.iter().map(absolute).collect::<Result<Vec<_>>>()?;
    let packages = tools::npm_packages("xtask/npm/peers/package.json")?;
    build::modules()?;
    let folder = root().join("target/peers");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    heading("ours, native: name, stream, bits, bytes, seconds to encode, to decode");
    let native = output_of(native_bench(&folder).args(&meshes))?;
    heading("theirs, and ours in WebAssembly; the last column: triangles that Draco leaves out");
    let mut node = program("node", &[]);
    node.arg(root().join("xtask/npm/peers/peers.mjs")).arg(&folder).arg(packages).arg(root().join("pkg"));
    let others = output_of(&mut node)?;
    let lines: Vec<&str> = native.lines().chain(others.lines()).filter(|l| l.contains('\t')).collect();
    let table = parse(&lines);
    heading("bytes at 12 bits a coordinate, positions and connectivity, as parts of Draco's");
    println!("{}", bytes_table(&table, &folder)?);
    heading("prefix beside Draco at other precisions, and speed in millions of triangles a second");
    println!("{}", speed_table(&table, &folder)?);
    let largest = largest(&table, &folder)?;
    let trade = trade(&table, &largest);
    let title = format!("{largest}: seconds until it is whole, against the link in Mbit/s");
    let curves: Vec<Curve> = trade.iter().map(|(name, points)| Curve { name, points }).collect();
    for (file, text) in [("ratios.svg", ratio_plot(&table)), ("trade.svg", log_plot(&title, &curves))] {
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{}", path.strip_prefix(root()).unwrap_or(&path).display());
    }
    if let Some(path) = csv {
        let text = lines.iter().fold("mesh,coder,bits,bytes,encode_secs,decode_secs\n".to_string(), |mut s, l| {
            let _ = writeln!(s, "{}", l.split('\t').take(6).collect::<Vec<_>>().join(","));
            s
        });
        std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

pub fn native_bench(folder: &Path) -> std::process::Command {
    let mut command = program("cargo", &[]);
    command.current_dir(root()).args(["bench", "--quiet", "-p", "pmesh-build", "--bench", "peers", "--"]).arg(folder);
    command
}

pub fn shared_models() -> Result<Vec<PathBuf>> {
    let folder = root().join("../shared/models");
    let entries =
        std::fs::read_dir(&folder).map_err(|_| "name the meshes to measure: there is no folder of models beside the project")?;
    let mut files: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "obj" || e == "off" || e == "ply"));
    files.sort();
    Ok(files)
}

fn parse(lines: &[&str]) -> Table {
    let mut table = Table::new();
    for line in lines {
        let words: Vec<&str> = line.split('\t').collect();
        let [name, coder, bits, bytes, encode, decode, ..] = words[..] else { continue };
        let (Ok(bits), Ok(bytes)) = (bits.parse(), bytes.parse()) else { continue };
        let figures = Figures { bytes, encode_secs: encode.parse().ok(), decode_secs: decode.parse().ok() };
        table.entry(name.into()).or_default().insert((coder.into(), bits), figures);
    }
    table
}

fn figures(table: &Table, name: &str, coder: &str, bits: u32) -> Option<Figures> {
    table.get(name)?.get(&(coder.to_string(), bits)).copied()
}

/// Vertices and triangles of a prepared mesh.
fn counts(folder: &Path, name: &str) -> Result<(f64, f64)> {
    let bytes = std::fs::read(folder.join(format!("{name}.raw"))).map_err(|e| format!("{name}.raw: {e}"))?;
    let number = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    Ok((f64::from(number(0)), f64::from(number(4))))
}

fn mean(ratios: &[f64]) -> f64 {
    (ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len().max(1) as f64).exp()
}

fn bytes_table(table: &Table, folder: &Path) -> Result<String> {
    let mut out = format!("| mesh | vertices | {REFERENCE}, bytes | bits a vertex |");
    CODERS[1..].iter().for_each(|c| out += &format!(" {c} |"));
    out += &format!(" prefix, bits a vertex |\n|{}\n", "---|".repeat(CODERS.len() + 4));
    let mut ratios = vec![Vec::new(); CODERS.len()];
    for name in table.keys() {
        let (Some(reference), (vertices, _)) = (figures(table, name, REFERENCE, 12), counts(folder, name)?) else { continue };
        let each = |bytes: f64| 8.0 * bytes / vertices;
        let _ = write!(out, "| {name} | {vertices} | {} | {:.2} |", reference.bytes, each(reference.bytes));
        for (i, coder) in CODERS.iter().enumerate().skip(1) {
            let Some(f) = figures(table, name, coder, 12) else { continue };
            ratios[i].push(f.bytes / reference.bytes);
            let _ = write!(out, " {:.3} |", f.bytes / reference.bytes);
        }
        let _ = writeln!(out, " {:.2} |", figures(table, name, "prefix", 12).map_or(0.0, |f| each(f.bytes)));
    }
    out += "| geometric mean | | | |";
    ratios[1..].iter().for_each(|r| out += &format!(" {:.3} |", mean(r)));
    Ok(out + " |\n")
}

fn ratio_plot(table: &Table) -> String {
    let bytes = |name: &str, coder: &str| figures(table, name, coder, 12).map_or(f64::NAN, |f| f.bytes);
    let of = |coder: &str| table.keys().map(|n| bytes(n, coder) / bytes(n, REFERENCE)).collect();
    let names: Vec<String> = table.keys().cloned().collect();
    bar_plot(&format!("bytes at 12 bits, as parts of {REFERENCE}'s"), &names, &[("prefix", of("prefix")), ("size", of("size"))])
}

/// The mesh with the most triangles.
fn largest(table: &Table, folder: &Path) -> Result<String> {
    let mut largest = (0.0, String::new());
    for name in table.keys() {
        let (_, triangles) = counts(folder, name)?;
        if triangles > largest.0 {
            largest = (triangles, name.clone());
        }
    }
    Ok(largest.1)
}

/// Of each coder (Mbit/s, seconds until mesh `name` is whole) in browsers; ours decode what has arrived while the rest comes, the other
/// waits for all of it.
fn trade(table: &Table, name: &str) -> [(&'static str, Vec<(f64, f64)>); 3] {
    let of = |coder: &str| figures(table, name, coder, 12).unwrap_or_default();
    let curve = |coder: &str, decoder: &str, streams: bool| {
        let (bytes, decode) = (of(coder).bytes, of(decoder).decode_secs.unwrap_or(f64::NAN));
        let at = |link: f64| {
            let download = bytes * 8.0 / (link * 1e6);
            (link, if streams { download.max(decode) } else { download + decode })
        };
        LINKS.map(at).to_vec()
    };
    [
        ("prefix", curve("prefix", "prefix wasm", true)),
        ("fast", curve("fast", "fast wasm", true)),
        (REFERENCE, curve(REFERENCE, REFERENCE, false)),
    ]
}

fn speed_table(table: &Table, folder: &Path) -> Result<String> {
    let mut out = "| mesh |".to_string();
    OTHER_BITS.iter().for_each(|b| out += &format!(" {b} bits |"));
    out += " encode prefix, native | decode prefix, native | wasm | decode fast, native | wasm | Draco encode, wasm | decode, wasm |\n";
    out += &format!("|{}\n", "---|".repeat(12));
    let mut ratios = vec![Vec::new(); OTHER_BITS.len()];
    for name in table.keys() {
        let (_, triangles) = counts(folder, name)?;
        let _ = write!(out, "| {name} |");
        for (i, &bits) in OTHER_BITS.iter().enumerate() {
            let (Some(ours), Some(theirs)) = (figures(table, name, "prefix", bits), figures(table, name, REFERENCE, bits)) else {
                continue;
            };
            ratios[i].push(ours.bytes / theirs.bytes);
            let _ = write!(out, " {:.3} |", ours.bytes / theirs.bytes);
        }
        let speed = |secs: Option<f64>| secs.map_or("-".to_string(), |s| format!("{:.2}", triangles / s.max(1e-9) / 1e6));
        let of = |coder: &str| figures(table, name, coder, 12).unwrap_or_default();
        let (prefix, fast, draco) = (of("prefix"), of("fast"), of(REFERENCE));
        for secs in [
            prefix.encode_secs,
            prefix.decode_secs,
            of("prefix wasm").decode_secs,
            fast.decode_secs,
            of("fast wasm").decode_secs,
            draco.encode_secs,
            draco.decode_secs,
        ] {
            let _ = write!(out, " {} |", speed(secs));
        }
        out.push('\n');
    }
    out += "| geometric mean |";
    ratios.iter().for_each(|r| out += &format!(" {:.3} |", mean(r)));
    Ok(out + " | | | | | | |\n")
}
