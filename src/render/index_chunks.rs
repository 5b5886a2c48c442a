//! An index buffer that grows without being copied: each chunk is as large as all before it together.

use super::gpu_mesh::{Uploader, buffer};

/// Triangles of the first chunk.
const FIRST_CHUNK: usize = 4096;
/// Triangles a page, the unit in which changes are noted.
const PAGE: usize = 1024;
/// Pages written at most in a step.
const STEP_PAGES: usize = 16;

/// What the chunks hold of a triangle.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Primitive {
    /// Its three corners.
    Faces,
    /// Its three edges, six indices.
    Lines,
}

impl Primitive {
    fn indices(self) -> usize {
        match self {
            Primitive::Faces => 3,
            Primitive::Lines => 6,
        }
    }
    fn bytes(self, corners: impl Iterator<Item = [u32; 3]>) -> Vec<u8> {
        match self {
            Primitive::Faces => corners.flatten().flat_map(u32::to_le_bytes).collect(),
            Primitive::Lines => corners.flat_map(|[a, b, c]| [a, b, b, c, c, a]).flat_map(u32::to_le_bytes).collect(),
        }
    }
}

/// Indices of all triangles that have arrived, on the GPU.
pub(super) struct IndexChunks {
    primitive: Primitive,
    chunks: Vec<wgpu::Buffer>,
    uploaded: usize,
    /// Pages that changed after they were uploaded.
    dirty: Vec<bool>,
}

/// First triangle of chunk `i`.
fn start(i: usize) -> usize {
    if i == 0 { 0 } else { FIRST_CHUNK << (i - 1) }
}
/// Chunk that triangle `t` is in.
fn chunk_of(t: usize) -> usize {
    (t / FIRST_CHUNK).checked_ilog2().map_or(0, |n| n as usize + 1)
}

impl IndexChunks {
    pub(super) fn new(primitive: Primitive) -> Self {
        Self { primitive, chunks: Vec::new(), uploaded: 0, dirty: Vec::new() }
    }
    /// Notes that a triangle changed.
    pub(super) fn touch(&mut self, triangle: usize) {
        if let Some(page) = self.dirty.get_mut(triangle / PAGE) {
            *page = true;
        }
    }
    pub(super) fn is_current(&self, triangles: usize) -> bool {
        self.uploaded == triangles && !self.dirty.contains(&true)
    }

    pub(super) fn has_changes(&self) -> bool {
        self.dirty.contains(&true)
    }

    /// Nothing past so many triangles counts any more.
    pub(super) fn truncate(&mut self, triangles: usize) {
        self.uploaded = self.uploaded.min(triangles);
        self.dirty.truncate(self.uploaded.div_ceil(PAGE));
    }

    /// Uploads some of what is missing of so many triangles, changes first; gives the bytes, 0 once all is there.
    pub(super) fn step(&mut self, up: &Uploader, triangles: usize, corners: impl Fn(usize) -> [u32; 3]) -> u64 {
        let changed = self.dirty.iter().position(|&d| d);
        let first = changed.map_or(self.uploaded, |page| page * PAGE);
        // To the end of the chunk, of the changed pages, or of the step.
        let chunk = chunk_of(first);
        let mut end = triangles.min(start(chunk + 1)).min(first + STEP_PAGES * PAGE);
        if let Some(page) = changed {
            let run = self.dirty[page..].iter().take_while(|&&d| d).count();
            end = end.min((page + run) * PAGE).min(self.uploaded);
        }
        if first >= end {
            return 0;
        }
        let width = self.primitive.indices();
        while self.chunks.len() <= chunk {
            let i = self.chunks.len();
            let size = (start(i + 1) - start(i)) * width * 4;
            // WebGL wants index buffers to be nothing else.
            self.chunks.push(buffer(up.device, size as u64, wgpu::BufferUsages::INDEX));
        }
        let bytes = self.primitive.bytes((first..end).map(corners));
        up.queue.write_buffer(&self.chunks[chunk], ((first - start(chunk)) * width * 4) as u64, &bytes);
        self.uploaded = self.uploaded.max(end);
        self.dirty.resize(self.uploaded.div_ceil(PAGE), false);
        if changed.is_some() {
            self.dirty[first / PAGE..end.div_ceil(PAGE)].fill(false);
        }
        bytes.len() as u64
    }

    /// Draws the first `triangles` triangles, as far as they are here.
    pub(super) fn draw(&self, pass: &mut wgpu::RenderPass, triangles: usize) {
        let width = self.primitive.indices();
        let end = triangles.min(self.uploaded);
        for (i, chunk) in self.chunks.iter().enumerate().take_while(|(i, _)| start(*i) < end) {
            let count = end.min(start(i + 1)) - start(i);
            pass.set_index_buffer(chunk.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..(count * width) as u32, 0, 0..1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_has_its_place_in_one_chunk() {
        for t in 0..5 * FIRST_CHUNK {
            let i = chunk_of(t);
            assert!(start(i) <= t && t < start(i + 1), "{t} in {i}");
        }
    }
}
