//! Textures of vertices that the vertex shader reads, and what binds them.

use super::gpu_mesh::Uploader;
use super::pipelines::Pipelines;

/// A texel a vertex; rows of the same length in all.
pub(super) struct Textures {
    pub(super) vertices: wgpu::Texture,
    pub(super) forest: wgpu::Texture,
    pub(super) normals: wgpu::Texture,
    pub(super) texcoords: wgpu::Texture,
    pub(super) rows: u32,
    row: u32,
}

impl Textures {
    /// `rows` rows of `row` texels; those of the forest and of texture coordinates only if there are such.
    pub(super) fn new(device: &wgpu::Device, row: u32, rows: u32, (forest, texcoords): (bool, bool)) -> Self {
        use wgpu::TextureFormat::{R32Uint, Rg32Uint, Rgba32Uint};
        use wgpu::TextureUsages as U;
        let texture = |format, is_used| {
            let (width, height) = if is_used { (row, rows) } else { (1, 1) };
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: U::TEXTURE_BINDING | U::COPY_DST | U::COPY_SRC,
                view_formats: &[],
            })
        };
        Self {
            vertices: texture(Rgba32Uint, true),
            forest: texture(Rg32Uint, forest),
            normals: texture(R32Uint, true),
            texcoords: texture(Rg32Uint, texcoords),
            rows,
            row,
        }
    }
    /// Has the GPU copy all texels to textures that are larger.
    pub(super) fn copy_to(&self, to: &Textures, up: &Uploader) {
        let mut encoder = up.device.create_command_encoder(&Default::default());
        let pairs = [
            (&self.vertices, &to.vertices),
            (&self.forest, &to.forest),
            (&self.normals, &to.normals),
            (&self.texcoords, &to.texcoords),
        ];
        for (from, to) in pairs {
            encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
        }
        up.queue.submit([encoder.finish()]);
    }
    /// Writes texels of `words` words each from `first` on, which begins a row; the last row is filled up with zeros. Gives the bytes.
    pub(super) fn write(
        &self,
        up: &Uploader,
        texture: &wgpu::Texture,
        (first, words): (u32, u32),
        values: impl Iterator<Item = u32>,
    ) -> u64 {
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
    /// Binds them with the uniforms and an image.
    pub(super) fn bind(
        &self,
        device: &wgpu::Device,
        pipelines: &Pipelines,
        uniforms: &wgpu::Buffer,
        image: Option<&wgpu::TextureView>,
    ) -> wgpu::BindGroup {
        let textures = [&self.vertices, &self.forest, &self.normals, &self.texcoords];
        let views = textures.map(|t| t.create_view(&Default::default()));
        let mut entries = vec![wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() }];
        for (i, view) in views.iter().enumerate() {
            entries.push(wgpu::BindGroupEntry { binding: i as u32 + 1, resource: wgpu::BindingResource::TextureView(view) });
        }
        let image = image.unwrap_or(&pipelines.white);
        entries.push(wgpu::BindGroupEntry { binding: 5, resource: wgpu::BindingResource::TextureView(image) });
        entries.push(wgpu::BindGroupEntry { binding: 6, resource: wgpu::BindingResource::Sampler(&pipelines.sampler) });
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &pipelines.layout, entries: &entries })
    }
}
