//! `cargo xtask fuzz`: the targets in fuzz/, built with coverage by the stable compiler, on a corpus of our own streams.

use crate::shell::{Result, heading, output_of, program, root, run};
use crate::tools;
use std::fs;
use std::path::{Path, PathBuf};

const TARGETS: [&str; 4] = ["decode", "cuts", "round_trip", "views"];
/// What `cargo fuzz` passes, but for the sanitizer: there is no unsafe code for it to watch.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table -Clink-dead-code \
    -Ccodegen-units=1 -Cdebug-assertions";
/// Ways to encode a sample, as arguments, and endings.
const STREAMS: [(&str, &[&str]); 7] = [
    ("views.pmesh", &["--profile", "views"]),
    ("prefix.pmesh", &["--profile", "prefix"]),
    ("exact.pmesh", &["--profile", "size", "--bits", "none"]),
    ("fast.pmesh", &["--profile", "fast"]),
    ("pits", &[]),
    ("pfs", &[]),
    ("slod", &["--simplifier", "closest"]),
];

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> String {
    move |e| format!("{}: {e}", path.display())
}

/// Runs the targets named, or all, each for some seconds. An error names the input that broke one.
pub fn run_targets(only: &[String], seconds: u64) -> Result<()> {
    if let Some(unknown) = only.iter().find(|o| !TARGETS.contains(&o.as_str())) {
        return Err(format!("no fuzz target is called {unknown:?}: there are {}", TARGETS.join(", ")));
    }
    tools::for_fuzzing()?;
    heading("building the fuzz targets");
    let version = output_of(program("rustc", &[]).arg("-vV"))?;
    let host = version.lines().find_map(|l| l.strip_prefix("host: ")).ok_or("rustc does not say for which machine it builds")?;
    let folder = root().join("target/fuzz");
    let mut build = program("cargo", &[]);
    // For a target that is named, build scripts are not instrumented.
    build.args(["build", "--quiet", "--release", "--manifest-path", "fuzz/Cargo.toml", "--target", host, "--target-dir"]);
    run(build.arg(&folder).env("RUSTFLAGS", COVERAGE))?;
    let seeds = seeds(&folder)?;
    for target in TARGETS.iter().filter(|t| only.is_empty() || only.iter().any(|o| o == *t)) {
        heading(&format!("{target}, {seconds} s"));
        let (corpus, found) = (folder.join("corpus").join(target), folder.join("found").join(target));
        for path in [&corpus, &found] {
            fs::create_dir_all(path).map_err(failed(path))?;
        }
        for seed in &seeds {
            let bytes = fs::read(seed).map_err(failed(seed))?;
            // The first byte says how a stream is cut, or what it is taken for.
            let bytes = match *target {
                "cuts" => [&[99], &bytes[..]].concat(),
                "views" => [&[0], &bytes[..]].concat(),
                _ => bytes,
            };
            let copy = corpus.join(seed.file_name().unwrap_or_default());
            fs::write(&copy, bytes).map_err(failed(&copy))?;
        }
        let mut fuzzer = program(&folder.join(host).join("release").join(target).to_string_lossy(), &[]);
        fuzzer.arg(&corpus).arg(format!("-max_total_time={seconds}")).arg(format!("-artifact_prefix={}/", found.display()));
        fuzzer.args([
            "-max_len=60000",
            "-timeout=30",
            "-rss_limit_mb=2000",
            "-print_final_stats=1",
            "-verbosity=0",
            "-print_funcs=0",
        ]);
        run(&mut fuzzer).map_err(|e| format!("{e}\nthe input that broke it is in {}", found.display()))?;
    }
    Ok(())
}

/// Small streams of every format.
fn seeds(folder: &Path) -> Result<Vec<PathBuf>> {
    let seeds = folder.join("seeds");
    fs::create_dir_all(&seeds).map_err(failed(&seeds))?;
    let pmesh = |args: &[&str], output: &Path| {
        let mut command = program("cargo", &[]);
        command.args(["run", "--quiet", "--release", "-p", "pmesh-cli", "--", "--quiet"]).args(args).arg("-o").arg(output);
        run(&mut command)
    };
    let sample = seeds.join("tetrahedra.ply");
    pmesh(&["sample", "tetrahedra"], &sample)?;
    for (ending, options) in STREAMS {
        let input = sample.to_string_lossy();
        pmesh(&[&["encode", &input], options].concat(), &seeds.join(format!("tetrahedra.{ending}")))?;
    }
    let golden = root().join("crates/pmesh-codec/tests/data");
    let mut all = Vec::new();
    for from in [seeds, golden] {
        let entries = fs::read_dir(&from).map_err(failed(&from))?;
        all.extend(entries.flatten().map(|e| e.path()).filter(|p| p.extension().is_some_and(|e| e != "ply")));
    }
    Ok(all)
}
