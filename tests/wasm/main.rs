//! Tests that run in real browsers, by `wasm-pack test`.
#![allow(missing_docs)]
#![cfg(target_arch = "wasm32")]
