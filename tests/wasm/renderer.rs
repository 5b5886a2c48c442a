//! The renderer on a real WebGL2 context: something is drawn, and levels cost no upload.

use crate::model::object;
use js_sys::{Array, Reflect};
use pmesh::{Model, Renderer};
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_test::wasm_bindgen_test;

const FIGURE_6: &[u8] = include_bytes!("../../crates/pmesh-codec/tests/data/figure6.lod");

fn options(level: f64) -> JsValue {
    let color: Array = [0.0, 0.0, 0.0, 0.0].into_iter().map(JsValue::from).collect();
    object(&[
        ("width", 64.into()),
        ("height", 64.into()),
        ("yaw", 0.into()),
        ("pitch", 0.into()),
        ("zoom", 1.into()),
        ("background", color.into()),
        ("baseColor", Array::new().into()),
        ("wireframe", false.into()),
        ("representatives", false.into()),
        ("shownLevel", level.into()),
    ])
}

#[wasm_bindgen_test]
async fn every_level_is_drawn_and_changing_it_uploads_nothing() {
    let canvas = web_sys::OffscreenCanvas::new(1, 1).expect("a canvas");
    let renderer = Renderer::create(canvas).await.expect("WebGL2");
    let model = Model::new();
    model.push(FIGURE_6).expect("it reads");
    let draw = |level: f64| {
        let result: JsValue = renderer.draw(&model, options(level).unchecked_ref()).expect("it draws").into();
        let number = |name: &str| Reflect::get(&result, &name.into()).expect("a result").as_f64().unwrap_or(-9.0);
        (number("level"), number("triangles"))
    };
    while draw(0.0).0 != 0.0 {}
    let uploaded = renderer.uploaded_bytes();
    assert!(uploaded > 0.0);
    for (level, triangles) in [(2.0, 2.0), (1.5, 6.0), (0.25, 10.0), (1.0, 6.0), (9.0, 2.0), (0.0, 10.0)] {
        assert_eq!(draw(level), (f64::min(level, 2.0), triangles));
    }
    assert_eq!(renderer.uploaded_bytes(), uploaded);
    assert_eq!(renderer.model_count(), 1);
    renderer.release(&model);
    assert_eq!(renderer.model_count(), 0);
}
