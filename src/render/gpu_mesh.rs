//! A mesh's mirror on the GPU: textures of vertices, forest, normals and texture coordinates, and the indices.
//!
//! It follows the core as levels arrive, a slice a frame; a level is *ready* once all of it is here, normals included.
//! Uploading early is harmless, since a prefix does not see past itself. Buffers double from the processor's copy.

use super::pipelines::{Pipelines, image};
use crate::error::error;
use crate::model::State;
use crate::shader::{FLAG_GIVEN_NORMALS, FLAG_IMAGE, Uniforms};
use crate::texels;
use pmesh_core::forest::JumpForest;
use pmesh_core::normals::NormalAccumulator;
use wasm_bindgen::JsValue;

/// Texels a row: 4,096 where the adapter has them.
const ROW_TEXELS: u32 = 4096;
/// Bytes uploaded a call, about: a few milliseconds.
const UPLOAD_BUDGET: u64 = 1 << 20;
/// Triangles whose normals are summed a call.
const NORMAL_BUDGET: usize = 40_000;
/// Corners a page of the index buffer.
const PAGE: usize = 4096;

pub(super) struct Uploader<'a> {
    pub(super) device: &'a wgpu::Device,
    pub(super) queue: &'a wgpu::Queue,
    pub(super) pipelines: &'a Pipelines,
    pub(super) texture_side: u32,
}

struct Textures {
    vertices: wgpu::Texture,
    forest: wgpu::Texture,
    normals: wgpu::Texture,
    texcoords: wgpu::Texture,
    rows: u32,
}

pub(super) struct GpuMesh {
    uniforms: wgpu::Buffer,
    row: u32,
    textures: Option<Textures>,
    group: Option<wgpu::BindGroup>,
    links: JumpForest,
    image: Option<wgpu::TextureView>,
    indices: Option<wgpu::Buffer>,
    index_capacity: usize,
    dirty_pages: Vec<bool>,
    lines: Option<(wgpu::Buffer, u32)>,
    uploaded_vertices: u32,
    uploaded_corners: usize,
    normals: Option<NormalAccumulator>,
    /// Computed normals as uploaded, for when the textures are replaced by larger ones.
    packed_normals: Vec<u32>,
    /// Levels whose normals are uploaded.
    normal_levels: u32,
    ready: u32,
    complete: bool,
    given_normals: bool,
    has_texcoords: bool,
}

fn buffer(device: &wgpu::Device, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
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
            indices: None,
            index_capacity: 0,
            dirty_pages: Vec::new(),
            lines: None,
            uploaded_vertices: 0,
            uploaded_corners: 0,
            normals: None,
            packed_normals: Vec::new(),
            normal_levels: 0,
            ready: 0,
            complete: false,
            given_normals: false,
            has_texcoords: false,
        }
    }
    pub(super) fn uniforms(&self) -> &wgpu::Buffer {
        &self.uniforms
    }
    pub(super) fn bind_group(&self) -> Option<&wgpu::BindGroup> {
        self.group.as_ref()
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

    pub(super) fn set_image(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        pipelines: &Pipelines,
        width: u32,
        height: u32,
        pixels: Vec<u8>,
    ) {
        self.image = Some(image(device, queue, &texels::mipmaps(width, height, pixels)));
        self.bind(device, pipelines);
    }

    /// Brings the mirror closer to the mesh by a slice; gives the bytes uploaded.
    pub(super) fn sync(&mut self, up: &Uploader, state: &mut State, wireframe: bool) -> Result<u64, JsValue> {
        for corner in std::mem::take(&mut state.changed_corners) {
            if let Some(page) = self.dirty_pages.get_mut(corner as usize / PAGE) {
                *page = true;
            }
        }
        let mesh = state.mesh();
        let set = mesh.attribute_set();
        (self.given_normals, self.has_texcoords) = (set.normals, set.texcoords);
        // What is complete when the slice begins is what it can make ready.
        let levels = mesh.arrived_levels();
        let mut spent = self.reserve(up, state)?;
        spent += self.upload_vertices(up, state);
        if spent < UPLOAD_BUDGET {
            spent += self.upload_corners(up, state, UPLOAD_BUDGET - spent);
        }
        let mesh = state.mesh();
        let geometry = self.uploaded_vertices as usize == mesh.vertices().len()
            && self.uploaded_corners == mesh.triangles().len() * 3
            && !self.dirty_pages.contains(&true);
        if geometry && levels > self.normal_levels {
            spent += self.step_normals(up, state, levels);
        }
        if geometry && self.normal_levels == levels {
            self.ready = levels;
        }
        self.complete = geometry && self.ready == state.mesh().arrived_levels();
        if wireframe && self.complete {
            spent += self.build_lines(up, state);
        }
        Ok(spent)
    }

    /// Grows textures and index buffer by doubling; what they held is uploaded again.
    fn reserve(&mut self, up: &Uploader, state: &State) -> Result<u64, JsValue> {
        let (vertices, corners) = (state.mesh().vertices().len() as u32, state.mesh().triangles().len() * 3);
        let mut spent = 0;
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
            self.textures = Some(Textures::new(up.device, self.row, rows, self.has_texcoords));
            self.bind(up.device, up.pipelines);
            // What was drawn must still be there in this frame: it goes up again at once.
            let before = std::mem::take(&mut self.uploaded_vertices);
            while self.uploaded_vertices < before {
                spent += self.upload_vertices(up, state);
            }
            if let Some(t) = self.textures.as_ref().filter(|_| !self.given_normals) {
                spent += self.write(up, &t.normals, 0, 1, self.packed_normals.iter().copied());
            }
        }
        if self.indices.is_none() || self.index_capacity < corners {
            self.index_capacity = corners.next_power_of_two().max(3 * PAGE);
            // WebGL wants index buffers to be nothing else.
            self.indices = Some(buffer(up.device, self.index_capacity as u64 * 4, wgpu::BufferUsages::INDEX));
            let before = std::mem::take(&mut self.uploaded_corners);
            while self.uploaded_corners < before {
                spent += self.upload_corners(up, state, UPLOAD_BUDGET);
            }
        }
        self.dirty_pages.resize(corners.div_ceil(PAGE).max(self.dirty_pages.len()), false);
        Ok(spent)
    }

    fn bind(&mut self, device: &wgpu::Device, pipelines: &Pipelines) {
        let Some(t) = &self.textures else { return };
        let views = [&t.vertices, &t.forest, &t.normals, &t.texcoords].map(|t| t.create_view(&Default::default()));
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: self.uniforms.as_entire_binding() }];
        for (i, view) in views.iter().enumerate() {
            entries.push(wgpu::BindGroupEntry { binding: i as u32 + 1, resource: wgpu::BindingResource::TextureView(view) });
        }
        let image = self.image.as_ref().unwrap_or(&pipelines.white);
        entries.push(wgpu::BindGroupEntry { binding: 5, resource: wgpu::BindingResource::TextureView(image) });
        entries.push(wgpu::BindGroupEntry { binding: 6, resource: wgpu::BindingResource::Sampler(&pipelines.sampler) });
        self.group = Some(device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipelines.layout,
            entries: &entries,
        }));
    }

    fn upload_vertices(&mut self, up: &Uploader, state: &State) -> u64 {
        let mesh = state.mesh();
        let total = mesh.vertices().len() as u32;
        let Some(textures) = &self.textures else { return 0 };
        if self.uploaded_vertices == total {
            return 0;
        }
        self.links.grow(mesh.representatives());
        // Whole rows, from the one that the next vertex is in.
        let first = self.uploaded_vertices / self.row * self.row;
        let rows = (UPLOAD_BUDGET / (u64::from(self.row) * 32)).max(1) as u32;
        let end = total.min(first + rows * self.row);
        let a = &mesh.vertices().attributes;
        let range = first as usize..end as usize;
        let color = |v: usize| a.colors.get(v).copied();
        let packed = range.clone().flat_map(|v| texels::vertex(mesh.vertices().positions[v], color(v)));
        let mut bytes = self.write(up, &textures.vertices, first, 4, packed);
        bytes += self.write(up, &textures.forest, first, 2, self.links.links[range.clone()].iter().flatten().copied());
        if self.given_normals {
            bytes += self.write(up, &textures.normals, first, 1, range.clone().map(|v| texels::normal(a.normals[v])));
        }
        if self.has_texcoords {
            bytes += self.write(up, &textures.texcoords, first, 2, range.flat_map(|v| a.texcoords[v].map(f32::to_bits)));
        }
        self.uploaded_vertices = end;
        bytes
    }

    /// Writes texels of `words` words each from `first` on, which begins a row; the last row is filled up with zeros.
    fn write(&self, up: &Uploader, texture: &wgpu::Texture, first: u32, words: u32, values: impl Iterator<Item = u32>) -> u64 {
        let mut bytes: Vec<u8> = values.flat_map(u32::to_le_bytes).collect();
        let row_bytes = (self.row * words * 4) as usize;
        let rows = bytes.len().div_ceil(row_bytes);
        bytes.resize(rows * row_bytes, 0);
        let to = wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: first / self.row, z: 0 },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row_bytes as u32), rows_per_image: None };
        let size = wgpu::Extent3d { width: self.row, height: rows as u32, depth_or_array_layers: 1 };
        if rows > 0 {
            up.queue.write_texture(to, &bytes, layout, size);
        }
        bytes.len() as u64
    }

    fn upload_corners(&mut self, up: &Uploader, state: &State, budget: u64) -> u64 {
        let corners = state.mesh().triangles().as_flattened();
        let Some(indices) = &self.indices else { return 0 };
        let mut spent = 0;
        let mut write = |from: usize, to: usize| {
            let bytes: Vec<u8> = corners[from..to].iter().flat_map(|v| v.to_le_bytes()).collect();
            up.queue.write_buffer(indices, from as u64 * 4, &bytes);
            spent += bytes.len() as u64;
            self.lines = None;
            spent < budget
        };
        // Old pages that changed, in runs.
        let mut page = 0;
        let known = self.uploaded_corners;
        while let Some(first) = (page..self.dirty_pages.len()).find(|&p| self.dirty_pages[p]) {
            let mut last = first;
            while last < self.dirty_pages.len() && self.dirty_pages[last] && last - first < 16 {
                self.dirty_pages[last] = false;
                last += 1;
            }
            page = last;
            let (from, to) = (first * PAGE, (last * PAGE).min(known));
            if from < to && !write(from, to) {
                return spent;
            }
        }
        while self.uploaded_corners < corners.len() {
            let to = corners.len().min(self.uploaded_corners + 16 * PAGE);
            let more = write(self.uploaded_corners, to);
            self.uploaded_corners = to;
            if !more {
                break;
            }
        }
        spent
    }

    /// Sums normals of level `levels` in slices and uploads them at the end; given ones are here already.
    fn step_normals(&mut self, up: &Uploader, state: &State, levels: u32) -> u64 {
        if self.given_normals {
            self.normal_levels = levels;
            return 0;
        }
        let mesh = state.mesh();
        let finest = mesh.level_count() - levels;
        let count = |r: Result<u32, _>| r.unwrap_or(0) as usize;
        let (vertices, triangles) = (count(mesh.vertex_end(finest)), count(mesh.triangle_count(finest)));
        let sums = self.normals.get_or_insert_with(|| NormalAccumulator::new(vertices));
        if sums.vertex_count() != vertices {
            // Another level has ended meanwhile: its normals will do for this one too.
            *sums = NormalAccumulator::new(vertices);
        }
        let positions = &mesh.vertices().positions;
        if !sums.add((positions, mesh.representatives()), &mesh.triangles()[..triangles], NORMAL_BUDGET) {
            return 0;
        }
        let normals = self.normals.take().map(|s| s.finish(mesh.seams())).unwrap_or_default();
        self.normal_levels = levels;
        self.packed_normals = normals.into_iter().map(texels::normal).collect();
        match &self.textures {
            Some(t) => self.write(up, &t.normals, 0, 1, self.packed_normals.iter().copied()),
            None => 0,
        }
    }

    fn build_lines(&mut self, up: &Uploader, state: &State) -> u64 {
        let triangles = state.mesh().triangles();
        if self.lines.as_ref().is_some_and(|l| l.1 == triangles.len() as u32) {
            return 0;
        }
        let corners = triangles.iter().flat_map(|[a, b, c]| [*a, *b, *b, *c, *c, *a]);
        let bytes: Vec<u8> = corners.flat_map(u32::to_le_bytes).collect();
        let lines = buffer(up.device, bytes.len().max(4) as u64, wgpu::BufferUsages::INDEX);
        up.queue.write_buffer(&lines, 0, &bytes);
        self.lines = Some((lines, triangles.len() as u32));
        bytes.len() as u64
    }

    pub(super) fn draw_faces(&self, pass: &mut wgpu::RenderPass, triangles: u32) {
        if let Some(indices) = &self.indices {
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..triangles * 3, 0, 0..1);
        }
    }
    pub(super) fn draw_lines(&self, pass: &mut wgpu::RenderPass, triangles: u32) {
        if let Some((lines, count)) = &self.lines {
            pass.set_index_buffer(lines.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..triangles.min(*count) * 6, 0, 0..1);
        }
    }
}

impl Textures {
    fn new(device: &wgpu::Device, width: u32, rows: u32, texcoords: bool) -> Self {
        let texture = |format, width, height| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                view_formats: &[],
            })
        };
        use wgpu::TextureFormat::{R32Uint, Rg32Uint, Rgba32Uint};
        let (tw, th) = if texcoords { (width, rows) } else { (1, 1) };
        Self {
            vertices: texture(Rgba32Uint, width, rows),
            forest: texture(Rg32Uint, width, rows),
            normals: texture(R32Uint, width, rows),
            texcoords: texture(Rg32Uint, tw, th),
            rows,
        }
    }
}
