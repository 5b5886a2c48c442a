//! What a push brought, as plain objects for the element; `ModelEvent` in the type definitions.

use crate::arrays::set;
use js_sys::{Array, Object, Uint8Array};
use pmesh_codec::{Arrival, StreamInfo};
use pmesh_core::ProgressiveMultilevelMesh;
use wasm_bindgen::JsValue;

fn object(kind: &str) -> Object {
    let object = Object::new();
    set(&object, "type", kind);
    object
}

/// The event of an arrival, if the page is told of it.
pub(crate) fn event(arrival: &Arrival, mesh: &ProgressiveMultilevelMesh, info: Option<&StreamInfo>) -> Option<JsValue> {
    let out = match arrival {
        Arrival::Part(_) => return None,
        Arrival::Texture(parts) if parts.mime == pmesh_codec::wavelet::MIME => return None,
        Arrival::Picture => object("picture"),
        Arrival::Info(info) => {
            let out = object("info");
            set(&out, "info", self::info(info));
            out
        }
        Arrival::Level { step, bytes, .. } => level(*step, *bytes, mesh, info),
        Arrival::Texture(texture) => {
            let out = object("texture");
            set(&out, "mime", texture.mime.as_str());
            set(&out, "bytes", Uint8Array::from(&texture.bytes[..]));
            out
        }
        Arrival::Elsewhere(urls) => {
            let out = object("elsewhere");
            set(&out, "urls", urls.iter().map(JsValue::from).collect::<Array>());
            out
        }
        Arrival::Warning(text) => {
            let out = object("warning");
            set(&out, "text", text.as_str());
            out
        }
    };
    Some(out.into())
}

/// `levelready`'s detail: step, level, level count (null while unknown), vertices, triangles, bytes, error (null if unknown).
pub(crate) fn level(step: u32, bytes: u64, mesh: &ProgressiveMultilevelMesh, info: Option<&StreamInfo>) -> Object {
    let out = object("level");
    let table = info.and_then(|i| i.levels.as_ref());
    let level = mesh.level_count() - 1 - step;
    set(&out, "step", step);
    set(&out, "level", level);
    set(&out, "levelCount", table.map_or(JsValue::NULL, |t| (t.len() as u32).into()));
    set(&out, "vertices", mesh.vertex_count(level).unwrap_or(0));
    set(&out, "triangles", mesh.triangle_count(level).unwrap_or(0));
    set(&out, "bytes", bytes as f64);
    let error = table.and_then(|t| t.get(step as usize)).map(|e| f64::from(e.error));
    set(&out, "error", error.map_or(JsValue::NULL, JsValue::from));
    out
}

/// The header as an object; `StreamInfo` in the type definitions.
pub(crate) fn info(info: &StreamInfo) -> Object {
    let out = Object::new();
    set(&out, "format", info.format);
    set(&out, "totalBytes", info.total_bytes.map_or(JsValue::NULL, |b| (b as f64).into()));
    set(&out, "textureEndByte", info.texture_end_byte.map_or(JsValue::NULL, |b| (b as f64).into()));
    set(&out, "positionBits", info.position_bits.map_or(JsValue::NULL, JsValue::from));
    let levels = info.levels.as_ref().map_or(JsValue::NULL, |table| {
        let rows = table.iter().enumerate().map(|(step, entry)| {
            let row = Object::new();
            set(&row, "level", (table.len() - 1 - step) as u32);
            set(&row, "endByte", entry.end_byte as f64);
            set(&row, "vertices", entry.vertex_count);
            set(&row, "triangles", entry.triangle_count);
            set(&row, "error", entry.error);
            row
        });
        rows.collect::<Array>().into()
    });
    set(&out, "levels", levels);
    out
}
