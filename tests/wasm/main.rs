//! Tests that run in real browsers, by `wasm-pack test`.
#![allow(missing_docs)]
#![cfg(target_arch = "wasm32")]

mod model;
mod renderer;

wasm_bindgen_test::wasm_bindgen_test_configure!(run_in_browser);
