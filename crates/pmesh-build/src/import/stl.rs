//! STL, ASCII and binary, by stl_io: a soup whose equal corners are one vertex here.

use super::Model;
use crate::BuildError;
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;
use std::io::Cursor;

pub(super) fn read(bytes: &[u8]) -> Result<Model, BuildError> {
    let file = |e: std::io::Error| BuildError::File { format: "STL", message: e.to_string() };
    let mut cursor = Cursor::new(bytes);
    let triangles = stl_io::create_stl_reader(&mut cursor).map_err(file)?;
    let mut vertices = Vertices::default();
    let mut index: HashMap<[u32; 3], u32> = HashMap::new();
    let mut out = Vec::new();
    for (i, triangle) in triangles.enumerate() {
        let offset = 84 + 50 * i;
        let triangle = triangle.map_err(|e| BuildError::Byte { format: "STL", offset, message: format!("triangle {i}: {e}") })?;
        out.push(triangle.vertices.map(|p| {
            // Zero has two signs in soups that are one point.
            let p = p.0.map(|x| if x == 0.0 { 0.0 } else { x });
            *index.entry(p.map(f32::to_bits)).or_insert_with(|| {
                vertices.positions.push(p);
                vertices.positions.len() as u32 - 1
            })
        }));
    }
    let warnings = vec!["STL's facet normals are not carried: they follow from the corners".to_string()];
    Ok(Model { mesh: IndexedMesh { vertices, triangles: out, position_of: Vec::new() }, texture: None, warnings })
}
