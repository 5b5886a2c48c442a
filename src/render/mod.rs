//! [`Renderer`]: one OffscreenCanvas, surface and device for all elements of a page (wgpu, WebGL2).
//!
//! It knows meshes and prefixes, no codec. An element asks for its picture, which appears in the top left corner of the
//! shared canvas, and copies it to its own before the next is drawn.

mod gpu_front;
mod gpu_mesh;
mod image;
mod index_chunks;
mod pipelines;
mod targets;
mod textures;

use crate::error::error;
use crate::model::{Model, ViewOptions};
use crate::shader::{self, Uniforms};
use crate::view_model::ViewModel;
use gpu_front::GpuFront;
use gpu_mesh::{GpuMesh, Uploader};
use image::ImageUpload;
use index_chunks::IndexChunks;
use pipelines::Pipelines;
use pmesh_codec::wavelet::Picture;
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::sync::Arc;
use targets::Targets;
use wasm_bindgen::prelude::*;

#[wasm_bindgen(typescript_custom_section)]
const TYPES: &str = r#"
/** What an upload is for. */
export interface UploadOptions {
  /** Edges too. */
  wireframe: boolean;
  /** `performance.now()` until which geometry may be uploaded; at least a step is. A few milliseconds from now by default. */
  deadline?: number;
}
/** How a picture is drawn. */
export interface DrawOptions extends ViewOptions {
  /** Red, green, blue, alpha, 0 to 1; alpha 0 is transparent. */
  background: number[];
  /** Colour of models without colours: red, green, blue. */
  baseColor: number[];
  wireframe: boolean;
  /** Colours triangles by their representative in the coarsest level. */
  representatives: boolean;
  /** Level to draw, if other than the model's: an animation on its way there. */
  shownLevel?: number;
  /** `performance.now()` until which geometry may be uploaded; at least a step is. A few milliseconds from now by default. */
  deadline?: number;
}
/** What a draw did. */
export interface DrawResult {
  /** False while geometry still waits for its turn to be uploaded: draw again. */
  complete: boolean;
  /** Levels, from the coarsest, whose geometry is on the GPU. */
  readyLevels: number;
  /** Level drawn; -1 if none was ready. */
  level: number;
  triangles: number;
}
"#;

#[wasm_bindgen]
extern "C" {
    /// A `DrawOptions`.
    #[wasm_bindgen(typescript_type = "DrawOptions", extends = ViewOptions)]
    pub type DrawOptions;
    #[wasm_bindgen(method, getter)]
    fn background(this: &DrawOptions) -> Vec<f64>;
    #[wasm_bindgen(method, getter, js_name = baseColor)]
    fn base_color(this: &DrawOptions) -> Vec<f64>;
    #[wasm_bindgen(method, getter)]
    fn wireframe(this: &DrawOptions) -> bool;
    #[wasm_bindgen(method, getter)]
    fn representatives(this: &DrawOptions) -> bool;
    #[wasm_bindgen(method, getter, js_name = shownLevel)]
    fn shown_level(this: &DrawOptions) -> Option<f64>;
    #[wasm_bindgen(method, getter)]
    fn deadline(this: &DrawOptions) -> Option<f64>;
    /// An `UploadOptions`.
    #[wasm_bindgen(typescript_type = "UploadOptions")]
    pub type UploadOptions;
    #[wasm_bindgen(method, getter)]
    fn wireframe(this: &UploadOptions) -> bool;
    #[wasm_bindgen(method, getter)]
    fn deadline(this: &UploadOptions) -> Option<f64>;
    /// A `DrawResult`.
    #[wasm_bindgen(typescript_type = "DrawResult")]
    pub type DrawResult;
}

/// Cosine of the angle between face and smooth normal beyond which an edge is shown sharp.
const CREASE_COSINE: f32 = 0.72;

/// Milliseconds of uploading a draw, if the page sets no deadline.
const UPLOAD_MS: f64 = 4.0;

/// What is painted.
struct Scene<'a> {
    group: Option<&'a wgpu::BindGroup>,
    faces: &'a IndexChunks,
    lines: Option<&'a IndexChunks>,
}

/// Draws models of any number of elements, one after the other.
#[wasm_bindgen]
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipelines: Pipelines,
    targets: RefCell<Targets>,
    meshes: RefCell<HashMap<u32, GpuMesh>>,
    fronts: RefCell<HashMap<u32, GpuFront>>,
    uploaded: Cell<f64>,
    texture_side: u32,
}

fn gpu_error(what: impl std::fmt::Display) -> JsValue {
    error("gpu", &format!("WebGL2 cannot be used here: {what}"))
}

#[wasm_bindgen]
impl Renderer {
    /// A renderer on `canvas`. Rejects with code `gpu` where there is no WebGL2.
    pub async fn create(canvas: web_sys::OffscreenCanvas) -> Result<Renderer, JsValue> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::GL;
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance.create_surface(wgpu::SurfaceTarget::OffscreenCanvas(canvas.clone())).map_err(gpu_error)?;
        let options = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = instance.request_adapter(&options).await.map_err(gpu_error)?;
        // The WebGL2 defaults stop at 2,048 texels a side; take what there is.
        let limits = wgpu::Limits::downlevel_webgl2_defaults().using_resolution(adapter.limits());
        let texture_side = limits.max_texture_dimension_2d;
        let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = adapter.request_device(&descriptor).await.map_err(gpu_error)?;
        // Colours are CSS colours: nothing is converted on the way out.
        let formats = surface.get_capabilities(&adapter).formats;
        let plain = formats.iter().find(|f| !f.is_srgb()).or(formats.first());
        let format = *plain.ok_or_else(|| gpu_error("no surface format"))?;
        let multisampled =
            adapter.get_texture_format_features(format).flags.contains(wgpu::TextureFormatFeatureFlags::MULTISAMPLE_X4);
        let samples = if multisampled { 4 } else { 1 };
        let pipelines = Pipelines::new(&device, &queue, format, samples).map_err(gpu_error)?;
        let targets = RefCell::new(Targets::new(surface, format, samples, canvas));
        let (meshes, fronts) = (RefCell::default(), RefCell::default());
        Ok(Renderer { device, queue, pipelines, targets, meshes, fronts, uploaded: Cell::new(0.0), texture_side })
    }

    /// Bytes of geometry uploaded since the beginning: changing a level adds none.
    #[wasm_bindgen(getter, js_name = uploadedBytes)]
    pub fn uploaded_bytes(&self) -> f64 {
        self.uploaded.get()
    }
    /// Models that have something on the GPU.
    #[wasm_bindgen(getter, js_name = modelCount)]
    pub fn model_count(&self) -> usize {
        self.meshes.borrow().len() + self.fronts.borrow().len()
    }

    /// Frees what the GPU holds of a model; drawing it again uploads it again.
    pub fn release(&self, model: &Model) {
        self.meshes.borrow_mut().remove(&model.id);
    }

    /// The same of a model that is refined where it is looked at.
    #[wasm_bindgen(js_name = releaseView)]
    pub fn release_view(&self, model: &ViewModel) {
        self.fronts.borrow_mut().remove(&model.id);
    }

    /// Gives a model its base-colour image: 8 bits a channel, red green blue alpha, rows from the top. It is uploaded as
    /// geometry is, and shows once it is whole; until then the one before it does.
    #[wasm_bindgen(js_name = setImage)]
    pub fn set_image(&self, model: &Model, width: u32, height: u32, pixels: Vec<u8>) -> Result<(), JsValue> {
        let fits = |n: u32| (1..=self.texture_side).contains(&n);
        if !fits(width) || !fits(height) || pixels.len() as u64 != u64::from(width) * u64::from(height) * 4 {
            return Err(error("bad-image", &format!("an image of {width} × {height} pixels cannot be a texture here")));
        }
        let mut meshes = self.meshes.borrow_mut();
        let mesh = meshes.entry(model.id).or_insert_with(|| GpuMesh::new(&self.device));
        mesh.set_image(ImageUpload::new(&self.device, Arc::new(Picture { width, height, pixels })));
        Ok(())
    }

    fn uploader(&self, deadline: Option<f64>) -> Uploader<'_> {
        Uploader {
            device: &self.device,
            queue: &self.queue,
            pipelines: &self.pipelines,
            texture_side: self.texture_side,
            deadline: deadline.unwrap_or_else(|| crate::stream::now() + UPLOAD_MS),
        }
    }

    fn sync(&self, model: &Model, wireframe: bool, deadline: Option<f64>) -> Result<(), JsValue> {
        let mut meshes = self.meshes.borrow_mut();
        let gpu = meshes.entry(model.id).or_insert_with(|| GpuMesh::new(&self.device));
        let uploaded = gpu.sync(&self.uploader(deadline), &mut model.state.borrow_mut(), wireframe)?;
        self.uploaded.set(self.uploaded.get() + uploaded as f64);
        Ok(())
    }

    /// Uploads what is new of a model, until the deadline. The result's level is -1 and its triangles 0.
    pub fn upload(&self, model: &Model, options: &UploadOptions) -> Result<DrawResult, JsValue> {
        self.sync(model, options.wireframe(), options.deadline())?;
        let meshes = self.meshes.borrow();
        Ok(meshes
            .get(&model.id)
            .map_or_else(|| result(false, 0, -1.0, 0), |g| result(g.is_complete(), g.ready_levels(), -1.0, 0)))
    }

    /// Draws a model at the top left of the canvas. Uploads what is new, until the deadline.
    pub fn draw(&self, model: &Model, options: &DrawOptions) -> Result<DrawResult, JsValue> {
        self.sync(model, options.wireframe(), options.deadline())?;
        let state = model.state.borrow();
        let mut meshes = self.meshes.borrow_mut();
        let gpu = meshes.entry(model.id).or_insert_with(|| GpuMesh::new(&self.device));
        let (orbit, width, height) = options.orbit();
        let view = orbit.view(state.bounds());
        let mesh = state.mesh();
        let wanted = options.shown_level().filter(|x| x.is_finite()).unwrap_or(mesh.level());
        let finest = f64::from(mesh.level_count().saturating_sub(gpu.ready_levels()));
        let level = wanted.max(finest).clamp(0.0, f64::from(mesh.level_count().saturating_sub(1)));
        if mesh.has_retired() {
            let uploaded = gpu.show(&self.uploader(options.deadline()), &state, level.floor() as u32);
            self.uploaded.set(self.uploaded.get() + uploaded as f64);
        }
        let prefix = if gpu.ready_levels() > 0 { mesh.prefix_of(level).unwrap_or_default() } else { Default::default() };
        let coarsest = mesh.vertex_end(mesh.level_count().saturating_sub(1)).unwrap_or(0);
        let [r, g, b] = color(&options.base_color(), [0.8, 0.8, 0.78]);
        let flags = gpu.flags() | if options.representatives() { shader::FLAG_REPRESENTATIVES } else { 0 };
        let uniforms = Uniforms {
            clip_from_world: view.clip_from_world.to_cols_array_2d(),
            eye: view.eye.extend(1.0).into(),
            base_color: [r, g, b, 1.0],
            counts: [prefix.vertex_count, prefix.coarse_vertex_count, coarsest, gpu.row_texels()],
            flags: [flags, 0, 0, 0],
            morph: [prefix.fraction, CREASE_COSINE, 0.0, 0.0],
        };
        self.queue.write_buffer(gpu.uniforms(), 0, &uniforms.to_bytes());
        self.paint(&gpu.scene(), prefix.triangle_count, options, (width, height))?;
        Ok(result(
            gpu.is_complete(),
            gpu.ready_levels(),
            if gpu.ready_levels() > 0 { level } else { -1.0 },
            if prefix.triangle_count > 0 { mesh.triangle_count(level.floor() as u32).unwrap_or(0) } else { 0 },
        ))
    }

    /// Draws the front of a model that is refined where it is looked at, as [`Self::draw`] does; all of it, and no level.
    #[wasm_bindgen(js_name = drawView)]
    pub fn draw_view(&self, model: &ViewModel, options: &DrawOptions) -> Result<DrawResult, JsValue> {
        let mut source = model.source.borrow_mut();
        let viewer = source.viewer_mut();
        let mut fronts = self.fronts.borrow_mut();
        let gpu = fronts.entry(model.id).or_insert_with(|| GpuFront::new(&self.device));
        let uploaded = gpu.sync(&self.uploader(None), viewer.front_mut(), options.wireframe())?;
        self.uploaded.set(self.uploaded.get() + uploaded as f64);
        let (orbit, width, height) = options.orbit();
        let [low, high] = viewer.extent();
        let view = orbit.view((low, high));
        let [r, g, b] = color(&options.base_color(), [0.8, 0.8, 0.78]);
        let uniforms = Uniforms {
            clip_from_world: view.clip_from_world.to_cols_array_2d(),
            eye: view.eye.extend(1.0).into(),
            base_color: [r, g, b, 1.0],
            // Every vertex is inside the prefix: it is drawn where it is.
            counts: [u32::MAX, u32::MAX, u32::MAX, gpu.row_texels()],
            flags: [if options.representatives() { shader::FLAG_REPRESENTATIVES } else { 0 }, 0, 0, 0],
            morph: [0.0, CREASE_COSINE, 0.0, 0.0],
        };
        self.queue.write_buffer(gpu.uniforms(), 0, &uniforms.to_bytes());
        let triangles = viewer.front().mesh().shown().len() as u32;
        self.paint(&gpu.scene(), triangles, options, (width, height))?;
        Ok(result(true, 0, -1.0, triangles))
    }

    fn paint(&self, scene: &Scene, triangles: u32, options: &DrawOptions, size: (u32, u32)) -> Result<(), JsValue> {
        let mut targets = self.targets.borrow_mut();
        let frame = targets.frame(&self.device, size, self.texture_side).map_err(gpu_error)?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let background = options.background();
            let alpha = background.get(3).copied().unwrap_or(1.0).clamp(0.0, 1.0);
            let [r, g, b] = color(&background, [1.0; 3]).map(|c| f64::from(c) * alpha);
            let mut pass = targets.begin(&mut encoder, &frame, wgpu::Color { r, g, b, a: alpha });
            pass.set_viewport(0.0, 0.0, size.0 as f32, size.1 as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, 0, size.0, size.1);
            if let Some(group) = scene.group.filter(|_| triangles > 0) {
                pass.set_bind_group(0, group, &[]);
                pass.set_pipeline(&self.pipelines.faces);
                scene.faces.draw(&mut pass, triangles as usize);
                if let Some(lines) = scene.lines.filter(|_| options.wireframe()) {
                    pass.set_pipeline(&self.pipelines.lines);
                    lines.draw(&mut pass, triangles as usize);
                }
            }
        }
        self.queue.submit([encoder.finish()]);
        self.queue.present(frame.texture);
        Ok(())
    }
}

fn color(values: &[f64], default: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|k| values.get(k).map_or(default[k], |x| *x as f32))
}

fn result(complete: bool, ready: u32, level: f64, triangles: u32) -> DrawResult {
    let object = js_sys::Object::new();
    crate::arrays::set(&object, "complete", complete);
    crate::arrays::set(&object, "readyLevels", ready);
    crate::arrays::set(&object, "level", level);
    crate::arrays::set(&object, "triangles", triangles);
    JsValue::from(object).unchecked_into()
}
