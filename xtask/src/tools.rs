//! Gets what is missing: the wasm target, wasm-bindgen in the version of Cargo.lock, a pinned wasm-pack, Node packages,
//! browsers. Everything goes into a cache outside target/, keyed by version, so that the second time is fast.

use crate::shell::{Result, exists, heading, program, root, run};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// In no Cargo.lock: pinned here.
const WASM_PACK: &str = "0.15.1";
const GECKODRIVER: &str = "0.37.1";

fn cache() -> Result<PathBuf> {
    let base = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let home = || std::env::var_os("HOME").map(|h| PathBuf::from(h).join(".cache"));
    let folder = base.or_else(home).ok_or("neither XDG_CACHE_HOME nor HOME is set")?.join("pmesh-tools");
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    Ok(folder)
}

/// The version of a package in Cargo.lock.
pub fn locked_version(package: &str) -> Result<String> {
    let lock = fs::read_to_string(root().join("Cargo.lock")).map_err(|e| format!("Cargo.lock: {e}"))?;
    let entry = lock.split("[[package]]").find(|e| e.contains(&format!("name = \"{package}\"\n")));
    let version = entry.and_then(|e| e.lines().find_map(|l| l.strip_prefix("version = ")));
    version.map(|v| v.trim_matches('"').to_string()).ok_or(format!("{package} is not in Cargo.lock"))
}

/// Folders with the tools that building needs, to go first on PATH.
pub fn for_build() -> Result<Vec<PathBuf>> {
    if !exists("node") || !exists("npm") {
        return Err("Node.js with npm is needed: install Node 20 or newer (on Debian: apt-get install nodejs npm)".into());
    }
    let targets = Command::new("rustup").args(["target", "list", "--installed"]).output();
    let installed = targets.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
    if !installed.contains("wasm32-unknown-unknown") {
        heading("adding the wasm target");
        run(Command::new("rustup").args(["target", "add", "wasm32-unknown-unknown"]))?;
    }
    let bindgen = locked_version("wasm-bindgen")?;
    Ok(vec![
        cargo_tool("wasm-bindgen-cli", &bindgen, "wasm-bindgen", false)?,
        cargo_tool("wasm-pack", WASM_PACK, "wasm-pack", true)?,
        npm_folder()?.join("node_modules/.bin"),
    ])
}

/// As [`for_build`], with drivers and browsers.
pub fn for_browsers() -> Result<Vec<PathBuf>> {
    install(&BROWSERS, "the browser tests")?;
    let mut tools = for_build()?;
    tools.push(cargo_tool("geckodriver", GECKODRIVER, "geckodriver", true)?);
    Ok(tools)
}

/// Where the Node packages that building and testing need are.
pub fn npm_folder() -> Result<PathBuf> {
    npm_packages("xtask/npm/package.json")
}

/// Where the Node packages of a manifest are.
pub fn npm_packages(manifest: &str) -> Result<PathBuf> {
    let manifest = root().join(manifest);
    let text = fs::read_to_string(&manifest).map_err(|e| format!("{}: {e}", manifest.display()))?;
    // A folder for each content of the manifest.
    let key = text.bytes().fold(0xcbf2_9ce4_8422_2325u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    let folder = cache()?.join(format!("npm-{key:016x}"));
    if !folder.join("installed").exists() {
        heading("installing Node packages");
        fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
        fs::write(folder.join("package.json"), text).map_err(|e| e.to_string())?;
        run(Command::new("npm").args(["install", "--no-audit", "--no-fund", "--loglevel=error"]).current_dir(&folder))?;
        fs::write(folder.join("installed"), "").map_err(|e| e.to_string())?;
    }
    Ok(folder)
}

fn cargo_tool(package: &str, version: &str, binary: &str, locked: bool) -> Result<PathBuf> {
    let folder = cache()?.join(format!("{package}-{version}"));
    let bin = folder.join("bin");
    if !bin.join(binary).is_file() {
        heading(&format!("installing {package} {version} (minutes, once)"));
        let mut install = Command::new("cargo");
        install.args(["install", package, "--version", version, "--root"]).arg(&folder);
        if locked {
            install.arg("--locked");
        }
        // A tool that runs for seconds need not be optimised for minutes.
        for (key, value) in [("LTO", "off"), ("OPT_LEVEL", "1"), ("CODEGEN_UNITS", "16"), ("DEBUG", "0")] {
            install.env(format!("CARGO_PROFILE_RELEASE_{key}"), value);
        }
        install.env("CARGO_TARGET_DIR", cache()?.join("target")).current_dir(cache()?);
        run(&mut install)?;
    }
    Ok(bin)
}

/// Programs that the browser tests need, with the Debian package of each.
const BROWSERS: [(&str, &str); 5] = [
    ("chromium", "chromium"),
    ("chromedriver", "chromium-driver"),
    ("firefox-esr", "firefox-esr"),
    ("xvfb-run", "xvfb"),
    ("xauth", "xauth"),
];

/// The same for libFuzzer, which is C++.
const COMPILER: [(&str, &str); 1] = [("c++", "g++")];

/// What building the fuzz targets needs.
pub fn for_fuzzing() -> Result<()> {
    install(&COMPILER, "the fuzz targets")
}

/// Installs the packages of those `programs` that are missing.
fn install(programs: &[(&str, &str)], for_what: &str) -> Result<()> {
    let missing: Vec<_> = programs.iter().filter(|b| !exists(b.0)).map(|b| b.1).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let advice = format!("install them by: apt-get install {}", missing.join(" "));
    let is_root = Command::new("id").arg("-u").output().is_ok_and(|o| o.stdout.starts_with(b"0\n"));
    if !exists("apt-get") || !is_root {
        return Err(format!("{for_what} need {}; {advice}", missing.join(", ")));
    }
    heading(&format!("installing {}", missing.join(", ")));
    let apt = |args: &[&str]| run(program("apt-get", &[]).args(args).env("DEBIAN_FRONTEND", "noninteractive"));
    apt(&["update", "-qq"])?;
    let mut args = vec!["install", "-y", "-qq", "--no-install-recommends"];
    args.extend(&missing);
    apt(&args).map_err(|e| format!("{e}; {advice}"))
}
