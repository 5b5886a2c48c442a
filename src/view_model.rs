//! [`ViewModel`]: a mesh that is refined where it is looked at, as JavaScript holds it. Messages go in and come out; sockets are the page's.

use crate::error::error;
use crate::model::ViewOptions;
use crate::model::next_id;
use crate::stream::now;
use pmesh_core::hierarchy::View;
use pmesh_view::{Client, Limits, ProtocolError};
use std::cell::RefCell;
use std::rc::Rc;
use wasm_bindgen::prelude::*;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/** How far a `ViewModel` follows the camera. */
export interface FollowOptions extends ViewOptions {
  /** Pixels that what is seen may be off by. */
  screenError: number;
  /** Triangles at most; the error allowed grows until that is enough. */
  maxTriangles?: number;
  /** Bytes of memory at most for what is known; what is not shown is forgotten first. */
  maxMemory?: number;
  /** `performance.now()` until which the front is looked through; a little is in any case. */
  deadline: number;
  /** Pixels that a vertex may move in this frame; Infinity: what changes is there at once. */
  morphPixels: number;
}
/** What following has done. */
export interface FollowResult {
  /** Vertices split, and collapsed. */
  splits: number; collapses: number;
  /** Nothing changes any more, until the camera moves or something arrives. */
  rests: boolean;
}
/** What a `ViewModel` has, and what it took. */
export interface ViewStats {
  /** Vertices of the front, and its triangles. */
  front: number; triangles: number;
  /** Nodes of the hierarchy that are here, and all. */
  known: number; total: number;
  /** Vertices on their way to their place. */
  moving: number;
  splits: number; bytesUp: number; bytesDown: number; memoryBytes: number;
  /** Times that what was not shown was forgotten. */
  evictions: number;
  /** By how much the allowed error was raised for the limits' sake: 1 is not at all. */
  coarser: number;
}
"#;

#[wasm_bindgen]
extern "C" {
    /// A `FollowOptions`.
    #[wasm_bindgen(typescript_type = "FollowOptions", extends = ViewOptions)]
    pub type FollowOptions;
    #[wasm_bindgen(method, getter, js_name = screenError)]
    fn screen_error(this: &FollowOptions) -> f64;
    #[wasm_bindgen(method, getter, js_name = maxTriangles)]
    fn max_triangles(this: &FollowOptions) -> Option<f64>;
    #[wasm_bindgen(method, getter, js_name = maxMemory)]
    fn max_memory(this: &FollowOptions) -> Option<f64>;
    #[wasm_bindgen(method, getter)]
    fn deadline(this: &FollowOptions) -> f64;
    #[wasm_bindgen(method, getter, js_name = morphPixels)]
    fn morph_pixels(this: &FollowOptions) -> f64;
    /// A `FollowResult`.
    #[wasm_bindgen(typescript_type = "FollowResult")]
    pub type FollowResult;
    /// A `ViewStats`.
    #[wasm_bindgen(typescript_type = "ViewStats")]
    pub type ViewStats;
}

/// Nodes looked at between two looks at the clock.
const LOOKS: u32 = 1000;
/// Vertices moved a frame, and normals turned.
const MOVES: u32 = 30_000;

fn failed(e: &ProtocolError) -> JsValue {
    let code = match e {
        ProtocolError::Syntax { .. } | ProtocolError::Unexpected(_) => "syntax",
        ProtocolError::OtherModel { .. } => "other-model",
        ProtocolError::View(_) => "bad-view",
        ProtocolError::Hierarchy(_) => "invalid-mesh",
        ProtocolError::Closed(_) => "server",
    };
    error(code, &e.to_string())
}

/// A mesh that is refined where it is looked at.
#[wasm_bindgen]
pub struct ViewModel {
    pub(crate) client: Rc<RefCell<Client>>,
    pub(crate) id: u32,
}

#[wasm_bindgen]
impl ViewModel {
    /// Of the model that a server calls so.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str) -> Self {
        Self { client: Rc::new(RefCell::new(Client::new(name).draw())), id: next_id() }
    }
    /// The next message for the server, if there is one.
    pub fn poll(&self) -> Option<Vec<u8>> {
        self.client.borrow_mut().poll()
    }
    /// Takes a message of the server. Throws an `Error` with a `code`: the session is over; what is here stays.
    pub fn receive(&self, bytes: &[u8]) -> Result<(), JsValue> {
        self.client.borrow_mut().receive(bytes).map_err(|e| failed(&e))
    }
    /// The connection is new: what comes next says what is here.
    pub fn reconnect(&self) {
        self.client.borrow_mut().reconnect();
    }
    /// Says goodbye.
    pub fn close(&self) {
        self.client.borrow_mut().close();
    }
    /// Follows the camera: refines what is too coarse, asks for what is missing, and moves what is under way by a frame. Throws if what arrived is no hierarchy.
    pub fn follow(&self, options: &FollowOptions) -> Result<FollowResult, JsValue> {
        let mut client = self.client.borrow_mut();
        let (orbit, _, height) = options.orbit();
        let [low, high] = client.extent();
        let camera = orbit.view((low, high));
        let pixel = 1.0 / f64::from(height.max(1));
        let tolerance = options.screen_error().clamp(0.01, 1e4) * pixel;
        let tangent = (crate::camera::FIELD_OF_VIEW / 2.0).tan();
        let view = View::new(camera.eye_from_world.to_cols_array(), tangent, orbit.aspect.max(0.01), tolerance as f32);
        let view = view.map_err(|e| failed(&e.into()))?;
        let limit = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or(usize::MAX, |x| x.max(1.0) as usize);
        client.set_limits(Limits { triangles: limit(options.max_triangles()), memory: limit(options.max_memory()) });
        let (mut splits, mut collapses, mut quiet) = (0, 0, 0);
        let mut rests = client.is_empty();
        while !client.is_empty() {
            let progress = client.refine(&view, LOOKS).map_err(|e| failed(&e))?;
            let changed = progress.splits + progress.collapses > 0;
            (splits, collapses) = (splits + progress.splits, collapses + progress.collapses);
            quiet = if changed { 0 } else { quiet + progress.looked as usize };
            rests = quiet >= client.front().len();
            if rests || now() >= options.deadline() {
                break;
            }
        }
        let under_way = client.advance(&view, options.morph_pixels().max(0.01) * pixel, MOVES).map_err(|e| failed(&e))?;
        let object = js_sys::Object::new();
        crate::arrays::set(&object, "splits", splits);
        crate::arrays::set(&object, "collapses", collapses);
        crate::arrays::set(&object, "rests", rests && under_way.moving + under_way.turning == 0);
        Ok(JsValue::from(object).unchecked_into())
    }
    /// True while the server owes an answer.
    #[wasm_bindgen(getter, js_name = isWaiting)]
    pub fn is_waiting(&self) -> bool {
        self.client.borrow().is_waiting()
    }
    /// True until the base mesh is here.
    #[wasm_bindgen(getter, js_name = isEmpty)]
    pub fn is_empty(&self) -> bool {
        self.client.borrow().is_empty()
    }
    /// True once nothing is left to ask for.
    #[wasm_bindgen(getter, js_name = hasAll)]
    pub fn has_all(&self) -> bool {
        self.client.borrow().has_all()
    }
    /// Smallest and largest corner of the bounding box: six numbers.
    #[wasm_bindgen(getter)]
    pub fn bounds(&self) -> Vec<f32> {
        self.client.borrow().extent().concat()
    }
    /// What is here, and what it took.
    #[wasm_bindgen(getter)]
    pub fn stats(&self) -> ViewStats {
        let client = self.client.borrow();
        let object = js_sys::Object::new();
        let (up, down) = client.bytes();
        for (name, value) in [
            ("front", client.front().len() as f64),
            ("triangles", client.front().mesh().shown().len() as f64),
            ("known", client.front().known() as f64),
            ("total", client.total() as f64),
            ("splits", client.splits() as f64),
            ("bytesUp", up as f64),
            ("bytesDown", down as f64),
            ("memoryBytes", client.front().memory_bytes() as f64),
            ("evictions", client.evictions() as f64),
            ("moving", f64::from(client.front().under_way().moving)),
            ("coarser", (f64::from(client.allowance()) / 4.0).exp2()),
        ] {
            crate::arrays::set(&object, name, value);
        }
        JsValue::from(object).unchecked_into()
    }
}
