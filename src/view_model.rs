//! [`ViewModel`]: a mesh that is refined where it is looked at, as JavaScript holds it. Messages go in and come out; sockets are the page's.

use crate::error::error;
use crate::model::ViewOptions;
use crate::model::next_id;
use crate::stream::now;
use pmesh_core::hierarchy::{Progress, View};
use pmesh_view::{Client, FileClient, Limits, ProtocolError, Viewer};
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
  /** Requests for ranges of a file. */
  requests: number;
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
        ProtocolError::Syntax { at: 0, .. } => "unknown-format",
        ProtocolError::Syntax { what, .. } if what.contains("too early") => "truncated",
        ProtocolError::Syntax { .. } | ProtocolError::Unexpected(_) => "syntax",
        ProtocolError::Damaged { .. } => "checksum",
        ProtocolError::OtherModel { .. } | ProtocolError::Refused(_) => "other-model",
        ProtocolError::View(_) => "bad-view",
        ProtocolError::Hierarchy(_) => "invalid-mesh",
        ProtocolError::Closed(_) => "server",
    };
    error(code, &e.to_string())
}

/// Where splits come from.
pub(crate) enum Source {
    Session(Box<Client>),
    File(Box<FileClient>),
}

impl Source {
    pub(crate) fn viewer(&self) -> &Viewer {
        match self {
            Self::Session(client) => client.viewer(),
            Self::File(client) => client.viewer(),
        }
    }
    pub(crate) fn viewer_mut(&mut self) -> &mut Viewer {
        match self {
            Self::Session(client) => client.viewer_mut(),
            Self::File(client) => client.viewer_mut(),
        }
    }
    fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, ProtocolError> {
        match self {
            Self::Session(client) => client.refine(view, budget),
            Self::File(client) => client.refine(view, budget),
        }
    }
    fn is_waiting(&self) -> bool {
        match self {
            Self::Session(client) => client.is_waiting(),
            Self::File(client) => client.is_waiting(),
        }
    }
    /// Bytes up, bytes down, requests.
    fn traffic(&self) -> (u64, u64, u64) {
        match self {
            Self::Session(client) => (client.bytes().0, client.bytes().1, 0),
            Self::File(client) => (0, client.traffic().1, client.traffic().0),
        }
    }
}

/// A mesh that is refined where it is looked at.
#[wasm_bindgen]
pub struct ViewModel {
    pub(crate) source: Rc<RefCell<Source>>,
    pub(crate) id: u32,
}

#[wasm_bindgen]
impl ViewModel {
    /// Of the model that a server of views calls so.
    #[wasm_bindgen(constructor)]
    pub fn new(name: &str) -> Self {
        Self { source: Rc::new(RefCell::new(Source::Session(Box::new(Client::new(name).draw())))), id: next_id() }
    }
    /// Of a file for views, by ranges of its bytes.
    #[wasm_bindgen(js_name = ofFile)]
    pub fn of_file() -> Self {
        Self { source: Rc::new(RefCell::new(Source::File(Box::new(FileClient::default().draw())))), id: next_id() }
    }
    /// The next message for the server, if there is one.
    pub fn poll(&self) -> Option<Vec<u8>> {
        match &mut *self.source.borrow_mut() {
            Source::Session(client) => client.poll(),
            Source::File(_) => None,
        }
    }
    /// The next range of the file to be fetched, if there is one: from the first number up to, not including, the second.
    #[wasm_bindgen(js_name = pollRange)]
    pub fn poll_range(&self) -> Option<Vec<f64>> {
        match &mut *self.source.borrow_mut() {
            Source::Session(_) => None,
            Source::File(client) => client.poll().map(|(start, end)| vec![start as f64, end as f64]),
        }
    }
    /// Takes a message of the server, or bytes of the file from `start` on. Throws an `Error` with a `code`: it is over; what is here stays.
    pub fn receive(&self, bytes: &[u8], start: Option<f64>) -> Result<(), JsValue> {
        let received = match &mut *self.source.borrow_mut() {
            Source::Session(client) => client.receive(bytes),
            Source::File(client) => client.receive(start.unwrap_or(0.0) as u64, bytes),
        };
        received.map_err(|e| failed(&e))
    }
    /// A range that was to be fetched does not come: it is asked for again.
    #[wasm_bindgen(js_name = rangeFailed)]
    pub fn range_failed(&self, start: f64) {
        if let Source::File(client) = &mut *self.source.borrow_mut() {
            client.failed(start as u64);
        }
    }
    /// The connection is new: what comes next says what is here.
    pub fn reconnect(&self) {
        if let Source::Session(client) = &mut *self.source.borrow_mut() {
            client.reconnect();
        }
    }
    /// Follows the camera: refines what is too coarse, asks for what is missing, and moves what is under way by a frame. Throws if what arrived is no hierarchy.
    pub fn follow(&self, options: &FollowOptions) -> Result<FollowResult, JsValue> {
        let mut source = self.source.borrow_mut();
        let (orbit, _, height) = options.orbit();
        let [low, high] = source.viewer().extent();
        let camera = orbit.view((low, high));
        let pixel = 1.0 / f64::from(height.max(1));
        let tolerance = options.screen_error().clamp(0.01, 1e4) * pixel;
        let view = View::new(camera.eye_from_world.to_cols_array(), camera.tangent, orbit.aspect.max(0.01), tolerance as f32);
        let view = view.map_err(|e| failed(&e.into()))?;
        let limit = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or(usize::MAX, |x| x.max(1.0) as usize);
        source.viewer_mut().set_limits(Limits { triangles: limit(options.max_triangles()), memory: limit(options.max_memory()) });
        let (mut splits, mut collapses, mut quiet) = (0, 0, 0);
        let mut rests = source.viewer().is_empty();
        while !source.viewer().is_empty() {
            let before = (source.viewer().front().known(), source.viewer().allowance());
            let progress = source.refine(&view, LOOKS).map_err(|e| failed(&e))?;
            // A block of a file may have come along with another, and be unpacked only now; another tolerance wants another look.
            let after = (source.viewer().front().known(), source.viewer().allowance());
            let changed = progress.splits + progress.collapses > 0 || after != before;
            (splits, collapses) = (splits + progress.splits, collapses + progress.collapses);
            quiet = if changed { 0 } else { quiet + progress.looked as usize };
            rests = quiet >= source.viewer().front().len();
            if rests || now() >= options.deadline() {
                break;
            }
        }
        let under_way =
            source.viewer_mut().advance(&view, options.morph_pixels().max(0.01) * pixel, MOVES).map_err(|e| failed(&e))?;
        let object = js_sys::Object::new();
        crate::arrays::set(&object, "splits", splits);
        crate::arrays::set(&object, "collapses", collapses);
        crate::arrays::set(&object, "rests", rests && under_way.moving + under_way.turning == 0);
        Ok(JsValue::from(object).unchecked_into())
    }
    /// True while something is to come.
    #[wasm_bindgen(getter, js_name = isWaiting)]
    pub fn is_waiting(&self) -> bool {
        self.source.borrow().is_waiting()
    }
    /// True until the base mesh is here.
    #[wasm_bindgen(getter, js_name = isEmpty)]
    pub fn is_empty(&self) -> bool {
        self.source.borrow().viewer().is_empty()
    }
    /// True once nothing is left to ask for.
    #[wasm_bindgen(getter, js_name = hasAll)]
    pub fn has_all(&self) -> bool {
        self.source.borrow().viewer().has_all()
    }
    /// What is here, and what it took.
    #[wasm_bindgen(getter)]
    pub fn stats(&self) -> ViewStats {
        let source = self.source.borrow();
        let (viewer, (up, down, requests)) = (source.viewer(), source.traffic());
        let front = viewer.front();
        let object = js_sys::Object::new();
        for (name, value) in [
            ("front", front.len() as f64),
            ("triangles", front.mesh().shown().len() as f64),
            ("known", front.known() as f64),
            ("total", viewer.total() as f64),
            ("splits", viewer.splits() as f64),
            ("bytesUp", up as f64),
            ("bytesDown", down as f64),
            ("requests", requests as f64),
            ("memoryBytes", viewer.memory_bytes() as f64),
            ("evictions", viewer.evictions() as f64),
            ("moving", f64::from(front.under_way().moving)),
            ("coarser", (f64::from(viewer.allowance()) / 4.0).exp2()),
        ] {
            crate::arrays::set(&object, name, value);
        }
        JsValue::from(object).unchecked_into()
    }
}
