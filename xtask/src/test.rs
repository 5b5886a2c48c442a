//! Every test, the fast ones first. Nothing is skipped in silence: a part that cannot run ends the whole with what to do.

use crate::shell::{Result, heading, output_of, own_path, program, root, run};
use crate::{build, fuzz, tools};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Compressed size of wgpu's minimal WebGL2 module, and how much more ours may be: a tenth, a hundredth more since it decodes seven
/// kinds of streams, and images, at two to three times the speed, three for the compact stream's decoder, which saves them with the
/// first model of some 3,000 triangles, three for compiling it for speed, which saves a fifth of its time, and ten for models that are refined
/// where they are looked at: six, three for coding their splits in half the bytes, and one for files of them that are half as large.
const WASM_BROTLI_LIMIT: usize = 583_025 * 127 / 100;

const PARTS: [&str; 6] = ["lint", "native", "fuzz", "wasm", "browser", "e2e"];

/// Seconds that each fuzz target runs here: enough to find what breaks at once.
const FUZZ_SECONDS: u64 = 15;

/// Runs the parts named, or all.
pub fn run_parts(only: &[String]) -> Result<()> {
    if let Some(unknown) = only.iter().find(|o| !PARTS.contains(&o.as_str())) {
        return Err(format!("no part is called {unknown:?}: there are {}", PARTS.join(", ")));
    }
    for part in PARTS.iter().filter(|p| only.is_empty() || only.iter().any(|o| o == *p)) {
        let started = Instant::now();
        match *part {
            "lint" => lint()?,
            "native" => native()?,
            "fuzz" => fuzz::run_targets(&[], FUZZ_SECONDS)?,
            "wasm" => wasm()?,
            "browser" => browser()?,
            _ => e2e()?,
        }
        println!("── {part} passed in {} s", started.elapsed().as_secs());
    }
    println!("\nall passed");
    Ok(())
}

fn cargo(args: &[&str]) -> Result<()> {
    run(program("cargo", &[]).args(args))
}

fn lint() -> Result<()> {
    heading("formatting and lints");
    cargo(&["fmt", "--all", "--check"])?;
    cargo(&["clippy", "--quiet", "--workspace", "--all-targets", "--", "-D", "warnings"])?;
    tools::for_build()?;
    cargo(&[
        "clippy",
        "--quiet",
        "--target",
        "wasm32-unknown-unknown",
        "-p",
        "pmesh",
        "-p",
        "pmesh-encoder",
        "--",
        "-D",
        "warnings",
    ])
}

fn native() -> Result<()> {
    heading("unit, property, golden and documentation tests");
    cargo(&["test", "--quiet", "--workspace"])
}

fn wasm() -> Result<()> {
    let sizes = build::modules()?;
    if sizes.brotli > WASM_BROTLI_LIMIT {
        return Err(format!("the module has {} bytes with brotli; the limit is {WASM_BROTLI_LIMIT}", sizes.brotli));
    }
    build::samples()
}

fn browser() -> Result<()> {
    let tools = tools::for_browsers()?;
    for (name, flag) in [("Chromium", "--chrome"), ("Firefox", "--firefox")] {
        heading(&format!("wasm-pack test in headless {name}"));
        run(in_display(&tools).args(["wasm-pack", "test", "--headless", flag, "--", "--test", "wasm"]))?;
    }
    Ok(())
}

/// xvfb-run: Firefox has WebGL2 only where there is a display.
fn in_display(tools: &[PathBuf]) -> std::process::Command {
    let mut command = program("xvfb-run", tools);
    command.arg("-a");
    command
}

fn node(script: &str, browser: &str, tools: &[PathBuf]) -> Result<std::process::Command> {
    let mut command = in_display(tools);
    command.args(["node", "--test", "--test-concurrency=1"]).arg(root().join("tests/e2e").join(script));
    with_programs(command, browser)
}

fn with_programs(mut command: std::process::Command, browser: &str) -> Result<std::process::Command> {
    command.env("PMESH_NODE_MODULES", tools::npm_folder()?).env("PMESH_BROWSER", browser);
    command.env("PMESH_XTASK", own_path()?).env("PMESH_CLI", own_path()?.with_file_name("../release/pmesh"));
    Ok(command)
}

fn e2e() -> Result<()> {
    let tools = tools::for_browsers()?;
    heading("the page end to end in Chromium");
    run(&mut node("element.test.mjs", "chrome", &tools)?)?;
    heading("views end to end in Chromium");
    run(&mut node("views.test.mjs", "chrome", &tools)?)?;
    heading("pictures against references");
    run(&mut node("screenshots.test.mjs", "chrome", &tools)?)?;
    heading("the page end to end in Firefox");
    run(&mut node("element.test.mjs", "firefox", &tools)?)?;
    heading("views end to end in Firefox");
    run(&mut node("views.test.mjs", "firefox", &tools)?)
}

/// Benchmarks, native ones first.
pub fn bench(meshes: &[PathBuf], quality: bool) -> Result<()> {
    let absolute = |m: &PathBuf| std::path::absolute(m).map_err(|e| format!("{}: {e}", m.display()));
    let meshes = meshes.iter().map(absolute).collect::<Result<Vec<_>>>()?;
    heading("native");
    let mut command = program("cargo", &[]);
    command.args(["bench", "--quiet", "-p", "pmesh-build", "--bench", "meshes", "--"]).args(&meshes);
    if quality {
        return run(command.arg("--quality"));
    }
    run(&mut command)?;
    let tools = tools::for_browsers()?;
    build::everything(&meshes)?;
    heading("WebAssembly in Chromium");
    run(&mut node_script("bench.mjs", "chrome", &tools)?)
}

/// KL04's experiments on each mesh; plots go to target/view.
pub fn bench_views(meshes: &[PathBuf], json: Option<&Path>) -> Result<()> {
    if meshes.is_empty() {
        return Err("which mesh? cargo xtask bench view-dependent MESH… [--json FILE]".into());
    }
    let absolute = |m: &Path| std::path::absolute(m).map_err(|e| format!("{}: {e}", m.display()));
    let plots = root().join("target/view");
    std::fs::create_dir_all(&plots).map_err(|e| format!("{}: {e}", plots.display()))?;
    let mut command = program("cargo", &[]);
    command.args(["bench", "--quiet", "-p", "pmesh-view", "--bench", "view", "--", "--plots"]).arg(&plots);
    for mesh in meshes {
        command.arg(absolute(mesh)?);
    }
    if let Some(json) = json {
        command.arg("--json").arg(absolute(json)?);
    }
    run(&mut command)?;
    println!("plots: target/view");
    Ok(())
}

/// `pmesh compare` with a column more: how long the browser takes.
pub fn compare(meshes: &[PathBuf]) -> Result<()> {
    let tools = tools::for_browsers()?;
    build::modules()?;
    let folder = root().join("www/models");
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    heading("every stream of every mesh");
    let mut command = program("cargo", &[]);
    command.args(["run", "--quiet", "--release", "-p", "pmesh-cli", "--", "compare", "--keep"]).arg(&folder).args(meshes);
    let table = output_of(&mut command)?;
    let lines: Vec<(String, &str)> = table
        .lines()
        .map(|line| {
            let words: Vec<&str> = line.split_whitespace().take(2).collect();
            (format!("/models/{}", words.join(".")), line)
        })
        .collect();
    heading("WebAssembly in Chromium");
    let times = output_of(node_script("bench.mjs", "chrome", &tools)?.args(lines.iter().skip(1).map(|l| &l.0)))?;
    for (url, line) in &lines {
        let words = times.lines().map(|l| l.split_whitespace().collect::<Vec<_>>()).find(|w| w.first() == Some(&url.as_str()));
        let shown = words.and_then(|w| w.iter().position(|x| *x == "decode").and_then(|i| w.get(i + 1).copied()));
        println!("{line} {:>10}", shown.unwrap_or("wasm ms"));
    }
    Ok(())
}

fn node_script(script: &str, browser: &str, tools: &[PathBuf]) -> Result<std::process::Command> {
    let mut command = in_display(tools);
    command.arg("node").arg(root().join("tests/e2e").join(script));
    with_programs(command, browser)
}

/// Renews the README's screenshots.
pub fn screenshots() -> Result<()> {
    let tools = tools::for_browsers()?;
    build::everything(&[])?;
    for browser in ["chrome", "firefox"] {
        heading(&format!("screenshot of the gallery in {browser}"));
        run(&mut node_script("gallery-screenshot.mjs", browser, &tools)?)?;
    }
    Ok(())
}
