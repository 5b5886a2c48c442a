//! `cargo xtask bench prefix`: what a client shows after any part of our bytes, beside the best files of that size.

use crate::peers::{native_bench, shared_models};
use crate::plot::{Curve, log_plot};
use crate::shell::{Result, heading, output_of, program, root};
use crate::tools;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// Measured if no mesh is named.
const USUAL: [&str; 3] = ["armadillo", "bunny", "horse"];

/// Of a mesh: (bytes, error).
#[derive(Default)]
struct Measured {
    /// At parts of Draco's bytes: (part, bytes, triangles, error).
    parts: Vec<(f64, f64, f64, f64)>,
    ours: Vec<(f64, f64)>,
    /// Files that could have been sent instead, the smallest first, none worse than a smaller one.
    envelope: Vec<(f64, f64)>,
}

/// Measures and prints Markdown; plots go to target/prefix.
pub fn run(meshes: &[PathBuf]) -> Result<()> {
    let meshes = if meshes.is_empty() {
        let usual = |m: &PathBuf| m.file_stem().is_some_and(|n| USUAL.iter().any(|u| n == *u));
        shared_models()?.into_iter().filter(usual).collect()
    } else {
        meshes.to_vec()
    };
    let absolute = |m: &PathBuf| std::path::absolute(m).map_err(|e| format!("{}: {e}", m.display()));
    let meshes = meshes.iter().map(absolute).collect::<Result<Vec<_>>>()?;
    let packages = tools::npm_packages("xtask/npm/peers/package.json")?;
    let folder = root().join("target/prefix");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut command = native_bench(&folder);
    meshes.iter().for_each(|mesh| {
        command.arg(mesh).arg("--raw");
    });
    output_of(&mut command)?;
    heading("files to send instead: name, number, bytes");
    let mut node = program("node", &[]);
    let files = lines(&output_of(node.arg(root().join("xtask/npm/peers/envelope.mjs")).arg(&folder).arg(packages))?);
    // The first of a mesh's at its last precision is the whole at 12 bits.
    let bytes_of = |name: &str, number: &str| {
        let of = |l: &&Vec<String>| l[0] == name && l[1] == number;
        files.iter().find(of).and_then(|l| l[2].parse::<f64>().ok())
    };
    heading("errors, 1/10000 of the diagonal: name, what, bytes, triangles, root mean square, maximum");
    let mut command = native_bench(&folder);
    for mesh in &meshes {
        let reference = bytes_of(&stem(mesh), WHOLE).ok_or("a mesh that Draco did not write")?;
        command.arg(mesh).arg("--curve").arg(reference.to_string());
    }
    let errors = lines(&output_of(&mut command)?);
    let mut all: BTreeMap<String, Measured> = BTreeMap::new();
    for line in &errors {
        let [name, what, bytes, triangles, rms, ..] = &line[..] else { continue };
        let number = |text: &String| text.parse::<f64>().unwrap_or(f64::NAN);
        let (bytes, rms) = (number(bytes), number(rms));
        let of = all.entry(name.clone()).or_default();
        if what == "ours" {
            of.ours.push((bytes, rms));
        } else if let Some(i) = what.strip_prefix("lod ") {
            of.envelope.extend(bytes_of(name, i).map(|b| (b, rms)));
        } else if let Ok(part) = what.parse() {
            of.parts.push((part, bytes, number(triangles), rms));
        }
    }
    all.values_mut().for_each(|m| m.envelope = best(std::mem::take(&mut m.envelope)));
    heading("error after parts of Draco's bytes, and of the best file of that size");
    println!("{}", table(&all));
    for (name, m) in &all {
        let path = folder.join(format!("{name}.svg"));
        let curves = [Curve { name: "ours", points: &m.ours }, Curve { name: "best file of that size", points: &m.envelope }];
        let text = log_plot(&format!("{name}: error (1/10000 of the diagonal) against bytes"), &curves);
        fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
        println!("{}", path.strip_prefix(root()).unwrap_or(&path).display());
    }
    Ok(())
}

/// Number of the file that holds the whole at 12 bits: envelope.mjs counts precisions first.
const WHOLE: &str = "4";

fn stem(mesh: &Path) -> String {
    mesh.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn lines(text: &str) -> Vec<Vec<String>> {
    let words = |l: &str| l.split('\t').map(str::to_string).collect::<Vec<_>>();
    text.lines().map(words).filter(|l| l.len() > 2).collect()
}

/// Those that no smaller file beats, by size.
fn best(mut files: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    files.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut least = f64::INFINITY;
    files.retain(|f| {
        let better = f.1 < least;
        least = least.min(f.1);
        better
    });
    files
}

/// The error at so many bytes: between two files as a power of the bytes.
fn between(files: &[(f64, f64)], bytes: f64) -> f64 {
    let after = files.iter().position(|f| f.0 >= bytes).unwrap_or(files.len());
    let (Some(a), Some(b)) = (after.checked_sub(1).and_then(|i| files.get(i)), files.get(after)) else { return f64::NAN };
    let part = (bytes / a.0).ln() / (b.0 / a.0).ln();
    if b.1 > 0.0 { a.1 * (b.1 / a.1).powf(part) } else { a.1 }
}

fn table(all: &BTreeMap<String, Measured>) -> String {
    let mut out =
        "| mesh | of Draco's bytes | bytes | triangles | ours | best file | ours / best |\n|---|---|---|---|---|---|---|\n"
            .to_string();
    for (name, m) in all {
        for &(part, bytes, triangles, rms) in &m.parts {
            let other = between(&m.envelope, bytes);
            let part = 100.0 * part;
            let _ =
                writeln!(out, "| {name} | {part:.0} % | {bytes} | {triangles} | {rms:.2} | {other:.2} | {:.2} |", rms / other);
        }
    }
    out
}
