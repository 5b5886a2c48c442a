//! `encode` for the browser: a mesh file in, a `.pmesh` file out. Runs in a worker, loaded only when a file is dropped.
#![cfg(target_arch = "wasm32")]

use js_sys::{Error, Function};
use pmesh_build::compact::{is_worth_it, take_apart};
use pmesh_build::import::import;
use pmesh_build::picture::convert;
use pmesh_build::pipeline::{BuildOptions, build};
use pmesh_build::simplify::BatchOptions;
use pmesh_codec::compact::{CompactStream, encode as encode_compact};
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

/// Encodes a mesh file as `pmesh encode` does, chosen by `name`'s extension, with `bits` a coordinate (8 to 16; 0 keeps every float). `progress`
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
    // A listener that throws does not stop the work.
    let mut progress = |part: f64| drop(progress.call1(&JsValue::NULL, &part.into()));
    let position_bits = (bits > 0).then_some(bits);
    let taken = take_apart(model.mesh, position_bits, BatchOptions::default(), &mut progress).map_err(error)?;
    let mut out = Vec::new();
    if is_worth_it(&taken) {
        encode_compact(&CompactStream { texture: model.texture, ..taken }, position_bits, &mut out).map_err(error)?;
    } else {
        model.mesh = taken.mesh;
        let stream = build(&model, &BuildOptions::default(), progress).map_err(error)?;
        write(&stream, EncodeOptions { position_bits }, &mut out).map_err(error)?;
    }
    Ok(out)
}
