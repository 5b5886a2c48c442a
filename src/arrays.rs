//! Plain objects of typed arrays: levels in, meshes out.

use crate::error::error;
use js_sys::{Array, Float32Array, Object, Reflect, Uint32Array};
use pmesh_core::{CornerMove, IndexedMesh, Level, MovedVertices, Vertices};
use wasm_bindgen::{JsCast, JsValue};

type Result<T> = std::result::Result<T, JsValue>;

fn bad(name: &str, expected: &str) -> JsValue {
    error("bad-level", &format!("{name}: {expected}"))
}

fn get(object: &JsValue, name: &str) -> Option<JsValue> {
    Reflect::get(object, &name.into()).ok().filter(|v| !v.is_undefined() && !v.is_null())
}

fn floats<const N: usize>(object: &JsValue, name: &str) -> Result<Vec<[f32; N]>> {
    let Some(value) = get(object, name) else { return Ok(Vec::new()) };
    let array: Vec<f32> = match value.dyn_ref::<Float32Array>() {
        Some(array) => array.to_vec(),
        None if Array::is_array(&value) => Float32Array::new(&value).to_vec(),
        None => return Err(bad(name, "a Float32Array or an array of numbers is expected")),
    };
    if !array.len().is_multiple_of(N) {
        return Err(bad(name, &format!("its length {} is not a multiple of {N}", array.len())));
    }
    Ok(array.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k])).collect())
}

fn integers<const N: usize>(object: &JsValue, name: &str) -> Result<Vec<[u32; N]>> {
    let Some(value) = get(object, name) else { return Ok(Vec::new()) };
    let array: Vec<u32> = match value.dyn_ref::<Uint32Array>() {
        Some(array) => array.to_vec(),
        None if Array::is_array(&value) => Uint32Array::new(&value).to_vec(),
        None => return Err(bad(name, "a Uint32Array or an array of numbers is expected")),
    };
    if !array.len().is_multiple_of(N) {
        return Err(bad(name, &format!("its length {} is not a multiple of {N}", array.len())));
    }
    Ok(array.chunks_exact(N).map(|c| std::array::from_fn(|k| c[k])).collect())
}

fn vertices(object: &JsValue) -> Result<Vertices> {
    let mut vertices = Vertices { positions: floats(object, "positions")?, ..Default::default() };
    vertices.attributes.normals = floats(object, "normals")?;
    vertices.attributes.colors = floats(object, "colors")?;
    vertices.attributes.texcoords = floats(object, "texcoords")?;
    Ok(vertices)
}

/// Reads the object that `addLevel` takes; see `LevelData` in the type definitions.
pub(crate) fn level(object: &JsValue) -> Result<Level> {
    if !object.is_object() {
        return Err(bad("addLevel", "an object of typed arrays is expected"));
    }
    let pair = |[a, b]: [u32; 2]| (a, b);
    let corner = |[triangle, corner, vertex]: [u32; 3]| CornerMove { triangle, corner: corner.min(255) as u8, vertex };
    let moved = match get(object, "moved") {
        Some(moved) => {
            let ids = integers::<1>(&moved, "ids")?.into_iter().map(|[v]| v).collect();
            MovedVertices { ids, values: vertices(&moved)? }
        }
        None => MovedVertices::default(),
    };
    Ok(Level {
        vertices: vertices(object)?,
        triangles: integers(object, "triangles")?,
        representatives: integers(object, "representatives")?.into_iter().map(pair).collect(),
        corner_moves: integers(object, "cornerMoves")?.into_iter().map(corner).collect(),
        moved,
        position_of: integers(object, "positionOf")?.into_iter().map(pair).collect(),
        retired: integers::<1>(object, "retired")?.into_iter().map(|[t]| t).collect(),
    })
}

/// Sets a property of a fresh object, which cannot fail.
pub(crate) fn set(object: &Object, name: &str, value: impl Into<JsValue>) {
    let _ = Reflect::set(object, &name.into(), &value.into());
}

/// The object that `arrays` gives; see `MeshArrays` in the type definitions.
pub(crate) fn mesh(mesh: &IndexedMesh) -> Object {
    let object = Object::new();
    let a = &mesh.vertices.attributes;
    set(&object, "positions", Float32Array::from(mesh.vertices.positions.as_flattened()));
    set(&object, "indices", Uint32Array::from(mesh.triangles.as_flattened()));
    if !a.normals.is_empty() {
        set(&object, "normals", Float32Array::from(a.normals.as_flattened()));
    }
    if !a.colors.is_empty() {
        set(&object, "colors", Float32Array::from(a.colors.as_flattened()));
    }
    if !a.texcoords.is_empty() {
        set(&object, "texcoords", Float32Array::from(a.texcoords.as_flattened()));
    }
    object
}
