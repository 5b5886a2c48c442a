//! The model's exports: push decoder, addLevel, setLevel, arrays, errors.

use js_sys::{Array, Float32Array, Object, Reflect, Uint32Array};
use pmesh::Model;
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_test::wasm_bindgen_test;

const FIGURE_6: &[u8] = include_bytes!("../../crates/pmesh-codec/tests/data/figure6.lod");

pub fn object(fields: &[(&str, JsValue)]) -> JsValue {
    let object = Object::new();
    for (name, value) in fields {
        Reflect::set(&object, &(*name).into(), value).expect("a fresh object");
    }
    object.into()
}

fn get(object: &JsValue, name: &str) -> JsValue {
    Reflect::get(object, &name.into()).expect("an object")
}

fn types(events: impl AsRef<JsValue>) -> Vec<String> {
    let events: Array = events.as_ref().clone().unchecked_into();
    events.iter().map(|e| get(&e, "type").as_string().expect("a type")).collect()
}

/// Floating point decides where everything of a compact stream stands: it must be the same here as where the file was written.
#[wasm_bindgen_test]
fn the_golden_compact_file_decodes_as_it_does_natively() {
    let model = Model::new();
    model.push(include_bytes!("../../crates/pmesh-codec/tests/data/version1-part.pmesh")).expect("it reads");
    model.finish().expect("it is whole");
    let arrays: JsValue = model.arrays(0.0).expect("level 0").into();
    let positions: Float32Array = get(&arrays, "positions").unchecked_into();
    let indices: Uint32Array = get(&arrays, "indices").unchecked_into();
    let numbers = positions.to_vec().into_iter().map(f32::to_bits).chain(indices.to_vec());
    let fingerprint = numbers.fold(0xcbf2_9ce4_8422_2325u64, |h, x| (h ^ u64::from(x)).wrapping_mul(0x0100_0000_01b3));
    assert_eq!(fingerprint, 0x40b6_297e_34b9_7dbe);
}

#[wasm_bindgen_test]
fn figure_6_plays_whatever_the_cuts() {
    for piece in [1, 7, 1000] {
        let model = Model::new();
        let mut seen = Vec::new();
        for chunk in FIGURE_6.chunks(piece) {
            seen.extend(types(model.push(chunk).expect("it reads")));
        }
        seen.extend(types(model.finish().expect("it is whole")));
        assert_eq!(seen, ["info", "level", "level", "level"]);
        assert_eq!((model.level_count(), model.arrived_levels(), model.finest_level()), (3, 3, 0));
        assert_eq!((model.vertex_count(1).ok(), model.triangle_count(1).ok()), (Some(7), Some(6)));
        let arrays: JsValue = model.arrays(1.0).expect("level 1").into();
        let indices: Uint32Array = get(&arrays, "indices").unchecked_into();
        assert_eq!(indices.to_vec(), [6, 2, 1, 3, 1, 2, 4, 6, 1, 5, 2, 6, 6, 4, 5, 4, 0, 5]);
        assert_eq!(model.bounds(), [-3.0, -3.0, 0.0, 3.0, 3.0, 0.0]);
    }
}

#[wasm_bindgen_test]
fn levels_are_added_and_morphed() {
    let model = Model::new();
    let floats = |f: &[f32]| JsValue::from(Float32Array::from(f));
    let integers = |i: &[u32]| JsValue::from(Uint32Array::from(i));
    let coarse = object(&[("positions", floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0.])), ("triangles", integers(&[0, 1, 2]))]);
    model.add_level(coarse.unchecked_ref()).expect("it fits");
    let fine = object(&[
        ("positions", floats(&[1., 1., 0.])),
        ("triangles", integers(&[1, 3, 2])),
        ("representatives", integers(&[3, 1])),
    ]);
    let event: JsValue = model.add_level(fine.unchecked_ref()).expect("it fits").into();
    assert_eq!(get(&event, "step").as_f64(), Some(1.0));
    assert!(get(&event, "levelCount").is_null());
    model.set_level(0.25).expect("a number");
    assert_eq!(model.level(), 0.25);
    let arrays: JsValue = model.arrays(0.25).expect("a fraction").into();
    let positions: Float32Array = get(&arrays, "positions").unchecked_into();
    assert_eq!(positions.to_vec()[9..], [1.0, 0.75, 0.0]);
    model.follow_newest();
    assert_eq!(model.level(), 0.0);
}

#[wasm_bindgen_test]
fn errors_have_stable_codes_and_what_arrived_stays() {
    let code = |e: JsValue| get(&e, "code").as_string().expect("a code");
    let model = Model::new();
    assert_eq!(code(model.push(b"GIF89a").err().expect("no mesh")), "unknown-format");
    assert_eq!(code(model.push(b"more").err().expect("it stopped")), "stopped");
    let model = Model::new();
    model.push(&FIGURE_6[..200]).expect("it reads");
    assert_eq!(code(model.finish().err().expect("it is cut short")), "truncated");
    assert_eq!(model.arrived_levels(), 1);
    assert_eq!(code(model.arrays(7.0).err().expect("there is none")), "no-such-level");
    assert_eq!(code(model.set_level(f64::NAN).err().expect("no number")), "no-such-level");
    let wrong = object(&[("positions", Float32Array::from(&[1.0f32, 2.0][..]).into())]);
    assert_eq!(code(Model::new().add_level(wrong.unchecked_ref()).err().expect("two thirds of a vertex")), "bad-level");
    assert_eq!(code(Model::new().add_level(JsValue::from(3).unchecked_ref()).err().expect("a number")), "bad-level");
}
