//! `encode` for the browser: a mesh file in, a `.pmesh` file out. Runs in a worker, loaded only when a file is dropped.
#![cfg(target_arch = "wasm32")]

use js_sys::{Error, Function};
use pmesh_build::import::import;
use pmesh_build::picture::convert;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_codec::pmesh::{EncodeOptions, encode as write};
use wasm_bindgen::prelude::*;

/// Runs once, when the module is instantiated.
#[wasm_bindgen(start)]
pub fn start() {
    console_error_panic_hook::set_once();
}

fn error(message: impl ToString) -> JsValue {
    Error::new(&message.to_string()).into()
}

/// Encodes a mesh file, chosen by `name`'s extension, with `bits` a coordinate (8 to 16; 0 keeps every float). `progress`
/// is called with the part done, 0 to 1; `warn` with each thing that cannot be carried. Throws an `Error`.
#[wasm_bindgen]
pub fn encode(name: &str, bytes: &[u8], bits: u8, progress: &Function, warn: &Function) -> Result<Vec<u8>, JsValue> {
    let mut model = import(name, bytes, &mut |_| None).map_err(error)?;
    if let Some(image) = model.texture.take() {
        // A model is more than its image.
        match convert(image, Default::default()) {
            Ok((image, warning)) => {
                model.texture = Some(image);
                model.warnings.extend(warning);
            }
            Err(e) => model.warnings.push(e.to_string()),
        }
    }
    for warning in &model.warnings {
        warn.call1(&JsValue::NULL, &warning.into())?;
    }
    let stream = build(&model, &BuildOptions::default(), |part| {
        // A listener that throws does not stop the work.
        let _ = progress.call1(&JsValue::NULL, &part.into());
    })
    .map_err(error)?;
    let mut out = Vec::new();
    let options = EncodeOptions { position_bits: (bits > 0).then_some(bits) };
    write(&stream, options, &mut out).map_err(error)?;
    Ok(out)
}
