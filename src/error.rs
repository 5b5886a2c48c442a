//! Errors as JavaScript sees them: `Error` objects with a stable `code`.

use js_sys::{Error, Reflect};
use pmesh_codec::DecodeError;
use pmesh_core::MeshError;
use wasm_bindgen::JsValue;

/// An `Error` with a `code` property.
pub(crate) fn error(code: &str, message: &str) -> JsValue {
    let error = Error::new(message);
    // Setting a property of a fresh object cannot fail.
    let _ = Reflect::set(&error, &"code".into(), &code.into());
    error.into()
}

pub(crate) fn decode_error(e: &DecodeError) -> JsValue {
    error(e.code(), &e.to_string())
}

pub(crate) fn mesh_error(e: &MeshError) -> JsValue {
    let code = match e {
        MeshError::NoSuchLevel { .. } | MeshError::LevelIsNaN | MeshError::Empty => "no-such-level",
        _ => "invalid-mesh",
    };
    error(code, &e.to_string())
}
