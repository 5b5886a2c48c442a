//! A front's mirror on the GPU: vertices where they are drawn, and a list of triangles. What has changed is written again, before each picture.

use super::Scene;
use super::gpu_mesh::{Uploader, buffer};
use super::index_chunks::{IndexChunks, Primitive};
use super::textures::Textures;
use crate::error::error;
use crate::shader::Uniforms;
use crate::texels;
use pmesh_core::hierarchy::Front;
use wasm_bindgen::JsValue;

/// Texels a row, the least that is written: short, since what moves lies all over.
const ROW_TEXELS: u32 = 512;

pub(super) struct GpuFront {
    uniforms: wgpu::Buffer,
    row: u32,
    textures: Option<Textures>,
    group: Option<wgpu::BindGroup>,
    faces: IndexChunks,
    lines: Option<IndexChunks>,
    /// Rows to be written.
    dirty: Vec<bool>,
}

impl GpuFront {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        Self {
            uniforms: buffer(device, Uniforms::BYTES as u64, wgpu::BufferUsages::UNIFORM),
            row: ROW_TEXELS,
            textures: None,
            group: None,
            faces: IndexChunks::new(Primitive::Faces),
            lines: None,
            dirty: Vec::new(),
        }
    }
    pub(super) fn uniforms(&self) -> &wgpu::Buffer {
        &self.uniforms
    }
    pub(super) fn row_texels(&self) -> u32 {
        self.row
    }
    pub(super) fn scene(&self) -> Scene<'_> {
        Scene { group: self.group.as_ref(), faces: &self.faces, lines: self.lines.as_ref() }
    }

    /// Brings the mirror up to date; gives the bytes written.
    pub(super) fn sync(&mut self, up: &Uploader, front: &mut Front, wireframe: bool) -> Result<u64, JsValue> {
        let is_new = self.textures.is_none();
        let (changed, places) = (front.take_changed_vertices(), front.take_changed_places());
        let positions = front.drawn_positions();
        self.row = ROW_TEXELS.min(up.texture_side);
        let rows = (positions.len() as u32).div_ceil(self.row).max(1);
        if rows > up.texture_side {
            let message = format!("{} vertices exceed the {} rows of a texture here", positions.len(), up.texture_side);
            return Err(error("too-large", &message));
        }
        if self.textures.as_ref().is_none_or(|t| t.rows < rows) {
            let larger = Textures::new(up.device, self.row, rows.next_power_of_two().min(up.texture_side), (false, false));
            if let Some(old) = &self.textures {
                old.copy_to(&larger, up);
            }
            self.group = Some(larger.bind(up.device, up.pipelines, &self.uniforms, None));
            self.textures = Some(larger);
        }
        self.dirty.resize(rows as usize, is_new);
        for v in changed {
            // What was forgotten since is not there any more.
            if let Some(row) = self.dirty.get_mut((v / self.row) as usize) {
                *row = true;
            }
        }
        let mut bytes = 0;
        if let Some(textures) = &self.textures {
            let mut row = 0;
            while row < self.dirty.len() {
                let run = self.dirty[row..].iter().take_while(|&&d| d).count();
                if run > 0 {
                    let first = row * self.row as usize;
                    let range = first..((row + run) * self.row as usize).min(positions.len());
                    let normals = front.drawn_normals();
                    let packed = range.clone().flat_map(|v| texels::vertex(positions[v], None));
                    bytes += textures.write(up, &textures.vertices, (first as u32, 4), packed);
                    let packed = range.map(|v| texels::normal(normals[v]));
                    bytes += textures.write(up, &textures.normals, (first as u32, 1), packed);
                }
                row += run.max(1);
            }
            self.dirty.fill(false);
        }
        if wireframe {
            self.lines.get_or_insert_with(|| IndexChunks::new(Primitive::Lines));
        }
        let shown = front.mesh().shown();
        let corners = |place: usize| front.mesh().triangle(shown[place]).unwrap_or([0; 3]);
        for chunks in std::iter::once(&mut self.faces).chain(&mut self.lines) {
            chunks.truncate(shown.len());
            places.iter().for_each(|&place| chunks.touch(place as usize));
            while !chunks.is_current(shown.len()) {
                bytes += chunks.step(up, shown.len(), corners);
            }
        }
        Ok(bytes)
    }
}
