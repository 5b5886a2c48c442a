//! Parses the shader, so that the browser module carries naga's tree instead of a parser. A typing error ends the build.

use std::path::PathBuf;

const SOURCE: &str = "src/render/shader.wgsl";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo::rerun-if-changed={SOURCE}");
    let source = std::fs::read_to_string(SOURCE)?;
    let module = naga::front::wgsl::parse_str(&source).map_err(|e| e.emit_to_string_with_path(&source, SOURCE))?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("shader.naga"), postcard::to_stdvec(&module)?)?;
    Ok(())
}
