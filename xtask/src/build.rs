//! Builds the browser modules and the streams of the gallery.

use crate::shell::{Result, heading, program, root, run};
use crate::tools;
use std::fs;
use std::path::{Path, PathBuf};

/// Samples of the gallery; `pmesh sample --help` says what they are.
const SAMPLES: [&str; 5] = ["globe", "marble", "knot", "part", "tetrahedra"];
/// Endings of the streams beside .pmesh; the knot is encoded as each.
const OTHER_STREAMS: [&str; 5] = ["lod.gz", "slod", "pits", "pfs", "x3d"];
/// Element files that go into the npm package beside the module.
const ELEMENT_FILES: [&str; 12] = [
    "pmesh-element.js",
    "pmesh-element.d.ts",
    "pmesh-attributes.js",
    "pmesh-controls.js",
    "pmesh-image.js",
    "pmesh-level-player.js",
    "pmesh-loader.js",
    "pmesh-ranges.js",
    "pmesh-runtime.js",
    "pmesh-template.js",
    "pmesh-view-player.js",
    "pmesh-views.js",
];

/// Raw and compressed size of a module.
pub struct Sizes {
    pub raw: usize,
    pub brotli: usize,
}

/// Modules, samples, and the meshes named.
pub fn everything(meshes: &[PathBuf]) -> Result<()> {
    modules()?;
    samples()?;
    user_models(meshes)
}

/// Builds the module of the element (pkg/) and the encoder (www/encoder/), both in release.
pub fn modules() -> Result<Sizes> {
    let tools = tools::for_build()?;
    heading("building the browser module (pkg/)");
    let pack = |folder: &str, out: &Path| {
        let mut command = program("wasm-pack", &tools);
        command.args(["--log-level", "warn", "build", "--target", "web", "--profile", "wasm", "--out-dir"]).arg(out).arg(folder);
        run(&mut command)
    };
    pack(".", &root().join("pkg"))?;
    complete_package()?;
    heading("building the encoder (www/encoder/)");
    pack("crates/pmesh-encoder", &root().join("www/encoder"))?;
    let sizes = size_of("pkg/pmesh_bg.wasm")?;
    println!("pkg/pmesh_bg.wasm: {} bytes, {} with brotli", sizes.raw, sizes.brotli);
    let encoder = size_of("www/encoder/pmesh_encoder_bg.wasm")?;
    println!("www/encoder/pmesh_encoder_bg.wasm: {} bytes, {} with brotli", encoder.raw, encoder.brotli);
    Ok(sizes)
}

fn size_of(path: &str) -> Result<Sizes> {
    let bytes = fs::read(path).map_err(|e| format!("{path}: {e}"))?;
    let mut out = Vec::new();
    let params = brotli::enc::BrotliEncoderParams { quality: 11, lgwin: 22, ..Default::default() };
    brotli::BrotliCompress(&mut &bytes[..], &mut out, &params).map_err(|e| e.to_string())?;
    Ok(Sizes { raw: bytes.len(), brotli: out.len() })
}

/// Adds the element to what wasm-pack wrote, and says so in package.json.
fn complete_package() -> Result<()> {
    let pkg = root().join("pkg");
    for file in ELEMENT_FILES {
        let from = root().join("www").join(file);
        fs::copy(&from, pkg.join(file)).map_err(|e| format!("{}: {e}", from.display()))?;
    }
    // wasm-pack keeps the folder out of git; here the project's own .gitignore does, and npm must not see it.
    let _ = fs::remove_file(pkg.join(".gitignore"));
    let version = env!("CARGO_PKG_VERSION");
    let manifest = format!(
        r#"{{
  "name": "pmesh",
  "version": "{version}",
  "description": "Progressive meshes: <p-mesh> and the WebAssembly module behind it",
  "license": "MIT",
  "type": "module",
  "exports": {{
    ".": {{ "types": "./pmesh-element.d.ts", "default": "./pmesh-element.js" }},
    "./module": {{ "types": "./pmesh.d.ts", "default": "./pmesh.js" }},
    "./pmesh_bg.wasm": "./pmesh_bg.wasm"
  }},
  "types": "./pmesh-element.d.ts",
  "sideEffects": ["./pmesh-element.js"],
  "files": ["*.js", "*.d.ts", "*.wasm", "README.md"]
}}
"#
    );
    fs::write(pkg.join("package.json"), manifest).map_err(|e| e.to_string())
}

fn pmesh(args: &[&str]) -> Result<()> {
    run(program("cargo", &[]).args(["run", "--release", "--quiet", "--package", "pmesh-cli", "--"]).args(args))
}

/// Encodes the samples into www/samples/.
pub fn samples() -> Result<()> {
    heading("encoding the samples (www/samples/)");
    fs::create_dir_all("www/samples").map_err(|e| e.to_string())?;
    SAMPLES.iter().try_for_each(|name| pmesh(&["sample", name, "-o", &format!("www/samples/{name}.pmesh")]))?;
    // One model as every other stream, and as a scene that names a file a level.
    pmesh(&["sample", "knot", "-o", "www/samples/knot-levels.wrl", "--split-levels"])?;
    pmesh(&["sample", "knot", "-o", "www/samples/knot-five.pmesh", "--simplifier", "closest", "--levels", "5"])?;
    pmesh(&["sample", "knot", "-o", "www/samples/knot-fast.pmesh", "--profile", "fast"])?;
    pmesh(&["--quiet", "sample", "globe", "-o", "www/samples/globe-views.pmesh", "--profile", "views", "--bits", "12"])?;
    without_views("www/samples/globe")?;
    OTHER_STREAMS.iter().try_for_each(|ending| pmesh(&["sample", "knot", "-o", &format!("www/samples/knot.{ending}")]))?;
    fs::copy("crates/pmesh-codec/tests/data/figure6.lod", "www/samples/figure6.lod").map(|_| ()).map_err(|e| e.to_string())
}

/// What `…-views.pmesh` holds as a stream without views, `…-whole.pmesh`: the other side of KL04's Figure 8.
fn without_views(stem: &str) -> Result<()> {
    let [views, mesh, whole] = ["-views.pmesh", "-whole.ply", "-whole.pmesh"].map(|end| format!("{stem}{end}"));
    pmesh(&["--quiet", "decode", &views, "-o", &mesh])?;
    pmesh(&["--quiet", "encode", &mesh, "-o", &whole, "--bits", "12"])?;
    fs::remove_file(&mesh).map_err(|e| format!("{mesh}: {e}"))
}

/// Encodes the user's meshes into www/models/ and lists them for the gallery.
fn user_models(meshes: &[PathBuf]) -> Result<()> {
    let folder = root().join("www/models");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let mut names = Vec::new();
    for mesh in meshes {
        heading(&format!("encoding {}", mesh.display()));
        let stem = mesh.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let safe: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() || "-_".contains(c) { c } else { '-' }).collect();
        let name = format!("{}-{}.pmesh", names.len() + 1, safe);
        pmesh(&["encode", &mesh.to_string_lossy(), "-o", &format!("www/models/{name}")])?;
        names.push(format!("\"{name}\""));
    }
    if let Some(first) = meshes.first() {
        // The gallery's two sides of a view.
        heading(&format!("encoding {} for views", first.display()));
        pmesh(&["encode", &first.to_string_lossy(), "-o", "www/models/first-views.pmesh", "--profile", "views", "--bits", "12"])?;
        without_views("www/models/first")?;
    }
    fs::write(folder.join("index.json"), format!("[{}]", names.join(", "))).map_err(|e| e.to_string())
}
