//! Mesh files to [`Model`]s. One file a format; what all share is here: choosing the format, wedges, seams, warnings.

mod gltf;
mod obj;
mod off;
mod ply;
mod scan;
mod stl;

use crate::BuildError;
use pmesh_codec::Texture;
use pmesh_core::IndexedMesh;
use std::collections::BTreeMap;

/// A mesh as it was read, with what could not be carried.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// The mesh. Vertices keep the order of the file; wedges beyond the first of a position follow behind.
    pub mesh: IndexedMesh,
    /// The base-colour image.
    pub texture: Option<Texture>,
    /// What the file holds that a progressive mesh cannot carry, and what was odd, each with its count.
    pub warnings: Vec<String>,
}

/// Gives the content of a file that a model names, such as a glTF's buffer; `None` if it is not to be had.
pub type Resolve<'a> = dyn FnMut(&str) -> Option<Vec<u8>> + 'a;

/// Reads a mesh file; the format is chosen by `name`'s extension, and by the first bytes where that says nothing.
/// Errors name the line or byte. No allocation is out of proportion to `bytes`.
pub fn import(name: &str, bytes: &[u8], resolve: &mut Resolve) -> Result<Model, BuildError> {
    let extension = name.rsplit('.').next().unwrap_or("").to_ascii_lowercase();
    // Some editors write a byte order mark before text.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let model = match extension.as_str() {
        "obj" => obj::read(bytes),
        "ply" => ply::read(bytes),
        "stl" => stl::read(bytes),
        "off" | "coff" | "noff" | "stoff" => off::read(bytes),
        "gltf" | "glb" => gltf::read(bytes, resolve),
        _ if bytes.starts_with(b"ply") => ply::read(bytes),
        _ if bytes.starts_with(b"glTF") => gltf::read(bytes, resolve),
        _ if bytes.starts_with(b"OFF") => off::read(bytes),
        _ => Err(BuildError::UnknownFormat { name: name.into() }),
    };
    finish(model?)
}

fn finish(mut model: Model) -> Result<Model, BuildError> {
    if model.mesh.vertices.is_empty() {
        return Err(BuildError::Empty);
    }
    if model.mesh.triangles.is_empty() {
        model.warnings.push("the file has no faces: nothing of it will be seen".into());
    }
    link_seams(&mut model.mesh);
    model.mesh.check()?;
    Ok(model)
}

/// Finds vertices at one position, bit for bit, and names the first of each. O(n log n).
pub fn link_seams(mesh: &mut IndexedMesh) {
    let key = |v: u32| mesh.vertices.positions[v as usize].map(f32::to_bits);
    let mut order: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    order.sort_unstable_by_key(|&v| (key(v), v));
    let mut seams = Vec::new();
    let mut first = order.first().copied().unwrap_or(0);
    for &v in order.iter().skip(1) {
        if key(v) == key(first) {
            seams.push((v, first));
        } else {
            first = v;
        }
    }
    seams.sort_unstable();
    mesh.position_of = seams;
}

/// Counts of what a file holds that cannot be carried.
#[derive(Default)]
struct Dropped(BTreeMap<String, usize>);

impl Dropped {
    fn note(&mut self, what: impl Into<String>) {
        *self.0.entry(what.into()).or_default() += 1;
    }
    fn into_warnings(self) -> Vec<String> {
        self.0.into_iter().map(|(what, count)| if count == 1 { what } else { format!("{what} ({count} times)") }).collect()
    }
}
