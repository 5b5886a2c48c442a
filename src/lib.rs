//! The browser module behind `<p-mesh>`: a push decoder with its mesh ([`Model`]), streaming, and a renderer.
//!
//! The element (`www/pmesh-element.js`) owns the page: DOM, events, fetching, animation frames. This module owns bytes,
//! levels and pixels. JavaScript never parses mesh bytes; nothing here touches the DOM.
//!
//! Everything but `camera`, `shader` and `texels` exists in the browser only.

pub mod camera;
pub mod shader;
pub mod texels;

#[cfg(target_arch = "wasm32")]
mod arrays;
#[cfg(target_arch = "wasm32")]
mod error;
#[cfg(target_arch = "wasm32")]
mod events;
#[cfg(target_arch = "wasm32")]
mod model;
#[cfg(target_arch = "wasm32")]
mod render;
#[cfg(target_arch = "wasm32")]
mod stream;
#[cfg(target_arch = "wasm32")]
mod view_model;

#[cfg(target_arch = "wasm32")]
pub use {model::Model, render::Renderer, view_model::ViewModel};

/// Runs once, when the module is instantiated: a panic is printed with its place.
#[cfg(target_arch = "wasm32")]
#[wasm_bindgen::prelude::wasm_bindgen(start)]
pub fn start() {
    console_error_panic_hook::set_once();
}
