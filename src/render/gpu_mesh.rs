//! A mesh's mirror on the GPU: textures of vertices, forest, normals and texture coordinates, and the indices.
//!
//! It follows the core as levels arrive, in steps of a fraction of a millisecond until a frame's time for it is over; a
//! level is *ready* once all of it is here, normals included. Uploading early is harmless, since a prefix does not see past
//! itself. Textures double, their texels copied by the GPU.

use super::Scene;
use super::image::{ImageUpload, fitting};
use super::index_chunks::{IndexChunks, Primitive};
use super::pipelines::Pipelines;
use super::textures::Textures;
use crate::error::error;
use crate::model::State;
use crate::shader::{FLAG_GIVEN_NORMALS, FLAG_IMAGE, Uniforms};
use crate::stream::now;
use crate::texels;
use pmesh_core::ProgressiveMultilevelMesh;
use pmesh_core::forest::JumpForest;
use pmesh_core::normals::NormalAccumulator;
use wasm_bindgen::JsValue;

/// Texels a row: 4,096 where the adapter has them.
const ROW_TEXELS: u32 = 4096;
/// Milliseconds of a frame's uploads while there is no picture yet, the first step not counted.
const FIRST_MS: f64 = 4.0;
/// Triangles whose normals are summed a step.
const NORMAL_STEP: usize = 10_000;

pub(super) struct Uploader<'a> {
    pub(super) device: &'a wgpu::Device,
    pub(super) queue: &'a wgpu::Queue,
    pub(super) pipelines: &'a Pipelines,
    pub(super) texture_side: u32,
    /// `performance.now()` at which the frame's time for uploads is over.
    pub(super) deadline: f64,
}

/// Normals on their way to the GPU.
struct Normals {
    /// Levels they are for.
    levels: u32,
    sums: NormalAccumulator,
    /// Uploaded up to this vertex, once all is summed.
    uploaded: Option<u32>,
}

pub(super) struct GpuMesh {
    uniforms: wgpu::Buffer,
    row: u32,
    textures: Option<Textures>,
    group: Option<wgpu::BindGroup>,
    links: JumpForest,
    image: Option<wgpu::TextureView>,
    image_upload: Option<ImageUpload>,
    /// Which of the stream's pictures is here or on its way.
    picture: u32,
    faces: IndexChunks,
    /// Kept from the first time that edges are drawn.
    lines: Option<IndexChunks>,
    uploaded_vertices: u32,
    normals: Option<Normals>,
    /// Levels, from the coarsest, whose normals are uploaded.
    normal_levels: u32,
    ready: u32,
    complete: bool,
    given_normals: bool,
    has_texcoords: bool,
    /// The level for which triangles that finer levels replace were left out.
    shown_level: u32,
}

pub(super) fn buffer(device: &wgpu::Device, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Corners of a triangle; of one that finer levels than `level` have only, or coarser ones, a point.
fn corners(mesh: &ProgressiveMultilevelMesh, triangle: usize, level: u32) -> [u32; 3] {
    if mesh.is_retired_at(triangle as u32, level) { [0; 3] } else { mesh.triangles()[triangle] }
}

impl GpuMesh {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            uniforms: buffer(device, Uniforms::BYTES as u64, wgpu::BufferUsages::UNIFORM),
            row: ROW_TEXELS,
            textures: None,
            group: None,
            links: JumpForest::default(),
            image: None,
            image_upload: None,
            picture: 0,
            faces: IndexChunks::new(Primitive::Faces),
            lines: None,
            uploaded_vertices: 0,
            normals: None,
            normal_levels: 0,
            ready: 0,
            complete: false,
            given_normals: false,
            has_texcoords: false,
            shown_level: u32::MAX,
        }
    }
    pub(super) fn uniforms(&self) -> &wgpu::Buffer {
        &self.uniforms
    }
    pub(super) fn row_texels(&self) -> u32 {
        self.row
    }
    /// Levels, from the coarsest, that can be drawn.
    pub(super) fn ready_levels(&self) -> u32 {
        self.ready
    }
    /// True if nothing waits to be uploaded.
    pub(super) fn is_complete(&self) -> bool {
        self.complete
    }
    pub(super) fn flags(&self) -> u32 {
        let image = self.has_texcoords && self.image.is_some();
        (if self.given_normals { FLAG_GIVEN_NORMALS } else { 0 }) | if image { FLAG_IMAGE } else { 0 }
    }

    /// Leaves out what `level` replaces, of a mesh whose levels replace triangles; gives the bytes uploaded. O(replaced ones).
    pub(super) fn show(&mut self, up: &Uploader, state: &State, level: u32) -> u64 {
        let mesh = state.mesh();
        let changed = mesh.retired_between(level, std::mem::replace(&mut self.shown_level, level));
        let mut bytes = 0;
        for chunks in std::iter::once(&mut self.faces).chain(&mut self.lines) {
            changed.iter().for_each(|&t| chunks.touch(t as usize));
            // What was there is written again at once; what is still to come goes on step by step.
            while chunks.has_changes() {
                bytes += chunks.step(up, mesh.triangles().len(), |t| corners(mesh, t, level));
            }
        }
        bytes
    }

    pub(super) fn set_image(&mut self, upload: ImageUpload) {
        self.image_upload = Some(upload);
    }

    /// Brings the mirror closer to the mesh until the deadline, by a step at least; gives the bytes uploaded.
    pub(super) fn sync(&mut self, up: &Uploader, state: &mut State, wireframe: bool) -> Result<u64, JsValue> {
        for corner in std::mem::take(&mut state.changed_corners) {
            self.faces.touch(corner as usize / 3);
            if let Some(lines) = &mut self.lines {
                lines.touch(corner as usize / 3);
            }
        }
        let set = state.mesh().attribute_set();
        (self.given_normals, self.has_texcoords) = (set.normals, set.texcoords);
        let (mut spent, mut deadline, mut first) = (0, up.deadline, true);
        loop {
            match self.step(up, state, wireframe)? {
                None => break,
                Some(bytes) => spent += bytes,
            }
            // Writes wait for a submission: let each step pay for its own.
            up.queue.submit([]);
            // The very first step waits for the GPU; what the first picture needs beside it is little.
            deadline = if first && self.ready == 0 { now() + FIRST_MS } else { deadline };
            first = false;
            if now() >= deadline {
                break;
            }
        }
        Ok(spent)
    }

    /// Does a little of what is missing; the bytes uploaded, or `None` if nothing is missing.
    fn step(&mut self, up: &Uploader, state: &State, wireframe: bool) -> Result<Option<u64>, JsValue> {
        let mesh = state.mesh();
        let (levels, triangles) = (mesh.arrived_levels(), mesh.triangles());
        self.complete = false;
        if (self.uploaded_vertices as usize) < mesh.vertices().len() {
            self.reserve(up, mesh.vertices().len() as u32)?;
            return Ok(Some(self.upload_vertices(up, state)));
        }
        if !self.faces.is_current(triangles.len()) {
            return Ok(Some(self.faces.step(up, triangles.len(), |t| corners(mesh, t, self.shown_level))));
        }
        if levels > self.normal_levels {
            let bytes = self.step_normals(up, state, levels);
            self.ready = self.normal_levels;
            return Ok(Some(bytes));
        }
        if let Some(upload) = &mut self.image_upload {
            let (bytes, whole) = upload.step(up.queue);
            if whole.is_some() {
                self.image = whole;
                self.image_upload = None;
                self.bind(up.device, up.pipelines);
            }
            return Ok(Some(bytes));
        }
        let (picture, version) = state.picture();
        if version > self.picture {
            self.picture = version;
            self.image_upload = Some(ImageUpload::new(up.device, fitting(picture, up.texture_side)));
            return Ok(Some(0));
        }
        if wireframe {
            let lines = self.lines.get_or_insert_with(|| IndexChunks::new(Primitive::Lines));
            if !lines.is_current(triangles.len()) {
                return Ok(Some(lines.step(up, triangles.len(), |t| corners(mesh, t, self.shown_level))));
            }
        }
        self.complete = true;
        Ok(None)
    }

    /// Makes room for `vertices`: larger textures, to which the GPU copies what there is.
    fn reserve(&mut self, up: &Uploader, vertices: u32) -> Result<(), JsValue> {
        self.row = ROW_TEXELS.min(up.texture_side);
        let rows = vertices.div_ceil(self.row).max(1);
        if rows > up.texture_side {
            let message = format!(
                "{vertices} vertices exceed the {} texels of a texture here",
                u64::from(self.row) * u64::from(up.texture_side)
            );
            return Err(error("too-large", &message));
        }
        if self.textures.as_ref().is_none_or(|t| t.rows < rows) {
            let rows = rows.next_power_of_two().min(up.texture_side);
            let larger = Textures::new(up.device, self.row, rows, (true, self.has_texcoords));
            if let Some(old) = &self.textures {
                old.copy_to(&larger, up);
            }
            self.textures = Some(larger);
            self.bind(up.device, up.pipelines);
        }
        Ok(())
    }

    fn bind(&mut self, device: &wgpu::Device, pipelines: &Pipelines) {
        let Some(textures) = &self.textures else { return };
        self.group = Some(textures.bind(device, pipelines, &self.uniforms, self.image.as_ref()));
    }

    fn upload_vertices(&mut self, up: &Uploader, state: &State) -> u64 {
        let mesh = state.mesh();
        let total = mesh.vertices().len() as u32;
        let Some(textures) = &self.textures else { return 0 };
        if self.uploaded_vertices == total {
            return 0;
        }
        // To the end of the row that the next vertex is in.
        let first = self.uploaded_vertices / self.row * self.row;
        let end = total.min(first + self.row);
        self.links.grow(&mesh.representatives()[..end as usize]);
        let a = &mesh.vertices().attributes;
        let range = first as usize..end as usize;
        let color = |v: usize| a.colors.get(v).copied();
        let packed = range.clone().flat_map(|v| texels::vertex(mesh.vertices().positions[v], color(v)));
        let mut bytes = textures.write(up, &textures.vertices, (first, 4), packed);
        bytes += textures.write(up, &textures.forest, (first, 2), self.links.links[range.clone()].iter().flatten().copied());
        if self.given_normals {
            bytes += textures.write(up, &textures.normals, (first, 1), range.clone().map(|v| texels::normal(a.normals[v])));
        }
        if self.has_texcoords {
            bytes += textures.write(up, &textures.texcoords, (first, 2), range.flat_map(|v| a.texcoords[v].map(f32::to_bits)));
        }
        self.uploaded_vertices = end;
        bytes
    }

    /// Sums and uploads normals of the newest level; given ones are here already.
    fn step_normals(&mut self, up: &Uploader, state: &State, levels: u32) -> u64 {
        let mesh = state.mesh();
        if self.given_normals {
            self.normal_levels = levels;
            return 0;
        }
        let finest = mesh.level_count() - levels;
        let count = |r: Result<u32, _>| r.unwrap_or(0) as usize;
        let (vertices, triangles) = (count(mesh.vertex_end(finest)), count(mesh.triangle_end(finest)));
        // If another level has ended since, its normals will do for the one before too; but what is summed is shown.
        let going = self.normals.take().filter(|n| n.levels == levels || n.uploaded.is_some());
        let mut normals = going.unwrap_or_else(|| Normals { levels, sums: NormalAccumulator::new(vertices), uploaded: None });
        let Some(from) = normals.uploaded else {
            let corners = (&mesh.vertices().positions[..], mesh.representatives());
            let gone = |t| mesh.is_retired_at(t, finest);
            if normals.sums.add(corners, &mesh.triangles()[..triangles], NORMAL_STEP, gone) {
                normals.sums.finish(mesh);
                normals.uploaded = Some(0);
            }
            self.normals = Some(normals);
            return 0;
        };
        let Some(t) = &self.textures else { return 0 };
        let total = normals.sums.vertex_count() as u32;
        let end = total.min(from + self.row);
        let bytes = t.write(up, &t.normals, (from, 1), (from..end).map(|v| texels::normal(normals.sums.normal(v))));
        if end == total {
            self.normal_levels = normals.levels;
        } else {
            self.normals = Some(Normals { uploaded: Some(end), ..normals });
        }
        bytes
    }

    pub(super) fn scene(&self) -> Scene<'_> {
        Scene { group: self.group.as_ref(), faces: &self.faces, lines: self.lines.as_ref() }
    }
}
