//! [`Model`]: a decoder and the mesh it grows, as JavaScript holds it. State is shared with the stream that feeds it and the
//! renderer that draws it; no call into JavaScript is made while it is borrowed.

use crate::arrays;
use crate::camera::Orbit;
use crate::error::{decode_error, error, mesh_error};
use crate::events;
use js_sys::{Array, Object};
use pmesh_codec::wavelet::Picture;
use pmesh_codec::{Arrival, DecodeError, LevelEntry, Receiver};
use pmesh_core::{Change, MeshError, ProgressiveMultilevelMesh};
use std::cell::{Cell, Ref, RefCell, RefMut};
use std::rc::Rc;
use std::sync::Arc;
use wasm_bindgen::prelude::*;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/** A level to add. Vertex indices are global, in order of arrival. Arrays may be typed or plain. */
export interface LevelData {
  /** x, y, z of each new vertex. */
  positions?: Float32Array | number[];
  normals?: Float32Array | number[];
  /** Red, green, blue, alpha of each new vertex, 0 to 1. */
  colors?: Float32Array | number[];
  texcoords?: Float32Array | number[];
  /** Three vertex indices a triangle; may point past what has arrived if a representative is known. */
  triangles?: Uint32Array | number[];
  /** Pairs: vertex, representative. */
  representatives?: Uint32Array | number[];
  /** Triples: triangle, corner (0 to 2), new vertex. */
  cornerMoves?: Uint32Array | number[];
  /** Triangles of earlier levels that this level and finer ones do not have. */
  retired?: Uint32Array | number[];
  /** Pairs: new vertex, earlier vertex at the same position. */
  positionOf?: Uint32Array | number[];
  /** Vertices of earlier levels that stand elsewhere from this level on. */
  moved?: { ids: Uint32Array | number[], positions: Float32Array | number[],
            normals?: Float32Array | number[], colors?: Float32Array | number[], texcoords?: Float32Array | number[] };
}
/** A level as arrays. */
export interface MeshArrays {
  positions: Float32Array; indices: Uint32Array;
  normals?: Float32Array; colors?: Float32Array; texcoords?: Float32Array;
}
/** An entry of a stream's level table. */
export interface LevelInfo { level: number; endByte: number; vertices: number; triangles: number; error: number; }
/** A stream's header. */
export interface StreamInfo {
  format: string; totalBytes: number | null; textureEndByte: number | null; positionBits: number | null;
  levels: LevelInfo[] | null;
}
/** A finished level. */
export interface LevelReady {
  type: "level"; step: number; level: number; levelCount: number | null;
  vertices: number; triangles: number; bytes: number; error: number | null;
}
export type ModelEvent = LevelReady | { type: "info"; info: StreamInfo }
  | { type: "texture"; mime: string; bytes: Uint8Array } | { type: "warning"; text: string }
  | { type: "elsewhere"; urls: string[] } | { type: "picture" };
/** Where the model is seen from. */
export interface ViewOptions {
  /** Size in device pixels. */
  width: number; height: number;
  /** Radians. */
  yaw: number; pitch: number;
  /** 1 fits the model. */
  zoom: number;
}
"#;

#[wasm_bindgen]
extern "C" {
    /// A `LevelData`.
    #[wasm_bindgen(typescript_type = "LevelData")]
    pub type LevelData;
    /// A `MeshArrays`.
    #[wasm_bindgen(typescript_type = "MeshArrays")]
    pub type MeshArrays;
    /// A `ModelEvent[]`.
    #[wasm_bindgen(typescript_type = "ModelEvent[]")]
    pub type ModelEvents;
    /// A `ModelEvent`.
    #[wasm_bindgen(typescript_type = "ModelEvent")]
    pub type ModelEvent;
    /// A `StreamInfo | undefined`.
    #[wasm_bindgen(typescript_type = "StreamInfo | undefined")]
    pub type StreamInfoOrNone;
    /// A `ViewOptions`.
    #[wasm_bindgen(typescript_type = "ViewOptions")]
    pub type ViewOptions;
    #[wasm_bindgen(method, getter)]
    pub fn width(this: &ViewOptions) -> f64;
    #[wasm_bindgen(method, getter)]
    pub fn height(this: &ViewOptions) -> f64;
    #[wasm_bindgen(method, getter)]
    pub fn yaw(this: &ViewOptions) -> f32;
    #[wasm_bindgen(method, getter)]
    pub fn pitch(this: &ViewOptions) -> f32;
    #[wasm_bindgen(method, getter)]
    pub fn zoom(this: &ViewOptions) -> f32;
}

impl ViewOptions {
    /// The camera, and the picture's size in pixels.
    pub(crate) fn orbit(&self) -> (Orbit, u32, u32) {
        let (w, h) = (self.width().clamp(1.0, 16384.0), self.height().clamp(1.0, 16384.0));
        let orbit = Orbit { yaw: self.yaw(), pitch: self.pitch(), zoom: self.zoom(), aspect: (w / h) as f32 };
        (orbit, w as u32, h as u32)
    }
}

/// What a model is made of; the renderer mirrors it on the GPU.
pub(crate) struct State {
    receiver: Receiver,
    /// Set while a mesh is fed with `addLevel` instead of bytes.
    levels_added: u32,
    /// Corners that hold another vertex since the renderer looked last.
    pub(crate) changed_corners: Vec<u32>,
    low: [f32; 3],
    high: [f32; 3],
    bounded: usize,
    finished: bool,
}

impl State {
    pub(crate) fn mesh(&self) -> &ProgressiveMultilevelMesh {
        self.receiver.mesh()
    }
    /// The bounding box of the finest level if the header says, else of what has arrived.
    pub(crate) fn bounds(&self) -> ([f32; 3], [f32; 3]) {
        match self.receiver.info().and_then(|i| i.bounds) {
            Some(bounds) => bounds,
            None if self.bounded == 0 => ([0.0; 3], [0.0; 3]),
            None => (self.low, self.high),
        }
    }
    fn grow_bounds(&mut self) {
        let positions = &self.receiver.mesh().vertices().positions;
        for p in &positions[self.bounded.min(positions.len())..] {
            if self.bounded == 0 {
                (self.low, self.high) = (*p, *p);
            }
            self.bounded += 1;
            for k in 0..3 {
                self.low[k] = self.low[k].min(p[k]);
                self.high[k] = self.high[k].max(p[k]);
            }
        }
    }
    fn take_change(&mut self, change: Change) {
        self.changed_corners.extend(change.corners);
    }
    /// Events of all that has arrived.
    pub(crate) fn events(&mut self) -> Vec<JsValue> {
        let mut out = Vec::new();
        while let Some(mut arrival) = self.receiver.poll() {
            match &mut arrival {
                Arrival::Part(change) | Arrival::Level { change, .. } => {
                    let change = std::mem::take(change);
                    self.take_change(change);
                }
                Arrival::Info(_) | Arrival::Texture(_) | Arrival::Picture | Arrival::Warning(_) | Arrival::Elsewhere(_) => {}
            }
            out.extend(events::event(&arrival, self.receiver.mesh(), self.receiver.info()));
        }
        self.grow_bounds();
        out
    }
    pub(crate) fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        self.receiver.push(bytes)
    }
    /// Takes bytes; [`Self::work`] does the rest in pieces.
    pub(crate) fn feed(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        self.receiver.feed(bytes)
    }
    /// Does a piece of what is left to do; false if nothing is.
    pub(crate) fn work(&mut self) -> Result<bool, DecodeError> {
        self.receiver.work()
    }
    pub(crate) fn finish(&mut self) -> Result<(), DecodeError> {
        self.receiver.finish()?;
        self.finished = true;
        Ok(())
    }
    /// The base-colour image as sharp as the stream has made it, and how many times it did.
    pub(crate) fn picture(&self) -> (&Arc<Picture>, u32) {
        self.receiver.picture()
    }
    pub(crate) fn bytes(&self) -> u64 {
        self.receiver.bytes()
    }
    pub(crate) fn is_whole(&self) -> bool {
        self.finished || self.total_bytes().is_some_and(|t| self.bytes() >= t)
    }
    /// Length of the stream, if the header says.
    pub(crate) fn total_bytes(&self) -> Option<u64> {
        self.receiver.info().and_then(|i| i.total_bytes)
    }
    fn table(&self) -> Option<&[LevelEntry]> {
        self.receiver.info()?.levels.as_deref()
    }
}

thread_local! {
    static NEXT_ID: Cell<u32> = const { Cell::new(1) };
}

/// A number that no other model of the page has.
pub(crate) fn next_id() -> u32 {
    NEXT_ID.with(|n| n.replace(n.get() + 1))
}

/// A progressive mesh: push bytes or add levels, ask for any level.
#[wasm_bindgen]
pub struct Model {
    pub(crate) state: Rc<RefCell<State>>,
    pub(crate) id: u32,
}

impl Default for Model {
    fn default() -> Self {
        Self::new()
    }
}

impl Model {
    fn get(&self) -> Ref<'_, State> {
        self.state.borrow()
    }
    fn get_mut(&self) -> RefMut<'_, State> {
        self.state.borrow_mut()
    }
}

fn number(level: Result<u32, MeshError>) -> Result<u32, JsValue> {
    level.map_err(|e| mesh_error(&e))
}

#[wasm_bindgen]
impl Model {
    /// An empty model, which takes any format.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        let state = State {
            receiver: Receiver::default(),
            levels_added: 0,
            changed_corners: Vec::new(),
            low: [0.0; 3],
            high: [0.0; 3],
            bounded: 0,
            finished: false,
        };
        Self { state: Rc::new(RefCell::new(state)), id: next_id() }
    }

    /// Takes the next bytes of the stream, cut anywhere; gives what they brought. Throws an `Error` with a `code`; levels
    /// that came before stay, and `takeEvents` gives what they were.
    pub fn push(&self, bytes: &[u8]) -> Result<ModelEvents, JsValue> {
        let pushed = self.get_mut().push(bytes);
        pushed.map_err(|e| decode_error(&e))?;
        Ok(self.take_events())
    }
    /// Says that the stream has ended; throws if it ends in the middle of something.
    pub fn finish(&self) -> Result<ModelEvents, JsValue> {
        let finished = self.get_mut().finish();
        finished.map_err(|e| decode_error(&e))?;
        Ok(self.take_events())
    }
    /// What arrived before an error was thrown.
    #[wasm_bindgen(js_name = takeEvents)]
    pub fn take_events(&self) -> ModelEvents {
        let events: Array = self.get_mut().events().into_iter().collect();
        events.unchecked_into()
    }

    /// Appends a level that the page made itself. Throws if it does not fit, or if the model is read from a stream; the mesh
    /// is then as it was.
    #[wasm_bindgen(js_name = addLevel)]
    pub fn add_level(&self, level: &LevelData) -> Result<ModelEvent, JsValue> {
        let level = arrays::level(level)?;
        let mut state = self.get_mut();
        if state.receiver.bytes() > 0 {
            return Err(error(
                "bad-level",
                "this model is read from a stream: levels of the page's own need a model of their own",
            ));
        }
        if state.levels_added == 0 {
            *state.receiver.mesh_mut() = ProgressiveMultilevelMesh::new(level.vertices.set());
        }
        let change = state.receiver.mesh_mut().add_level(&level).map_err(|e| mesh_error(&e))?;
        state.levels_added += 1;
        state.take_change(change);
        state.grow_bounds();
        let step = state.mesh().arrived_levels() - 1;
        let event = events::level(step, state.bytes(), state.mesh(), state.receiver.info());
        Ok(JsValue::from(event).unchecked_into())
    }

    /// Asks for a level, fractional ones too; nothing is built or uploaded. Kept, and clamped to what has arrived.
    #[wasm_bindgen(js_name = setLevel)]
    pub fn set_level(&self, level: f64) -> Result<(), JsValue> {
        self.get_mut().receiver.mesh_mut().set_level(level).map_err(|e| mesh_error(&e))
    }
    /// Shows the newest finished level from now on.
    #[wasm_bindgen(js_name = followNewest)]
    pub fn follow_newest(&self) {
        self.get_mut().receiver.mesh_mut().follow_newest();
    }
    /// The level shown.
    #[wasm_bindgen(getter)]
    pub fn level(&self) -> f64 {
        self.get().mesh().level()
    }
    /// Levels in all, as far as known.
    #[wasm_bindgen(getter, js_name = levelCount)]
    pub fn level_count(&self) -> u32 {
        self.get().mesh().level_count()
    }
    /// Levels that have arrived.
    #[wasm_bindgen(getter, js_name = arrivedLevels)]
    pub fn arrived_levels(&self) -> u32 {
        self.get().mesh().arrived_levels()
    }
    /// Number of the finest level that has arrived.
    #[wasm_bindgen(getter, js_name = finestLevel)]
    pub fn finest_level(&self) -> u32 {
        self.get().mesh().finest_level()
    }
    /// Bytes pushed so far: where a range request resumes.
    #[wasm_bindgen(getter)]
    pub fn bytes(&self) -> f64 {
        self.get().bytes() as f64
    }
    /// True once every byte has arrived.
    #[wasm_bindgen(getter, js_name = isWhole)]
    pub fn is_whole(&self) -> bool {
        self.get().is_whole()
    }
    /// Bytes of memory the mesh takes, the GPU's and the decoder's left out.
    #[wasm_bindgen(getter, js_name = memoryBytes)]
    pub fn memory_bytes(&self) -> f64 {
        self.get().mesh().memory_bytes() as f64
    }
    /// The header, once it has arrived.
    #[wasm_bindgen(getter)]
    pub fn info(&self) -> StreamInfoOrNone {
        let state = self.get();
        let info = state.receiver.info().map(events::info);
        info.map_or(JsValue::UNDEFINED, JsValue::from).unchecked_into()
    }
    /// Smallest and largest corner of the bounding box: six numbers.
    #[wasm_bindgen(getter)]
    pub fn bounds(&self) -> Vec<f32> {
        let (low, high) = self.get().bounds();
        [low, high].concat()
    }
    /// Vertices of a whole level.
    #[wasm_bindgen(js_name = vertexCount)]
    pub fn vertex_count(&self, level: u32) -> Result<u32, JsValue> {
        number(self.get().mesh().vertex_count(level))
    }
    /// Triangles of a whole level.
    #[wasm_bindgen(js_name = triangleCount)]
    pub fn triangle_count(&self, level: u32) -> Result<u32, JsValue> {
        number(self.get().mesh().triangle_count(level))
    }
    /// The mesh of any level as arrays, fractional ones morphed. O(its size).
    pub fn arrays(&self, level: f64) -> Result<MeshArrays, JsValue> {
        let mesh = self.get().mesh().mesh_at(level).map_err(|e| mesh_error(&e))?;
        let object: Object = arrays::mesh(&mesh);
        Ok(JsValue::from(object).unchecked_into())
    }

    /// The finest level, announced or arrived, of at most so many triangles; the coarsest if none is that small.
    #[wasm_bindgen(js_name = levelForTriangles)]
    pub fn level_for_triangles(&self, triangles: f64) -> u32 {
        let state = self.get();
        let count = state.mesh().level_count();
        let within = |level: &u32| match state.table() {
            Some(table) => table.get((count - 1 - level) as usize).is_some_and(|l| f64::from(l.triangle_count) <= triangles),
            None => state.mesh().triangle_count(*level).is_ok_and(|t| f64::from(t) <= triangles),
        };
        (0..count).find(within).unwrap_or(count.saturating_sub(1))
    }
    /// The coarsest level whose error is at most `pixels` in this view; 0 where the stream says nothing of errors.
    #[wasm_bindgen(js_name = levelForPixels)]
    pub fn level_for_pixels(&self, pixels: f64, view: &ViewOptions) -> u32 {
        let state = self.get();
        let (orbit, _, height) = view.orbit();
        let allowed = pixels * f64::from(orbit.view(state.bounds()).units_per_height) / f64::from(height);
        let Some(table) = state.table() else { return 0 };
        let step = table.iter().position(|entry| f64::from(entry.error) <= allowed);
        step.map_or(0, |step| (table.len() - 1 - step) as u32)
    }
}
