//! A base-colour image on its way to the GPU, mipmaps made on the way, a band of rows a step.

use crate::texels::halve_rows;
use pmesh_codec::wavelet::Picture;
use std::sync::Arc;

/// Pixels a step: a fraction of a millisecond.
const STEP_PIXELS: u32 = 1 << 15;

/// Uploads an image of 8 bits a channel, red green blue alpha, rows from the top.
pub(super) struct ImageUpload {
    texture: wgpu::Texture,
    mip: u32,
    /// Width, height and pixels of this mipmap, and the next one as far as it is made.
    size: (u32, u32),
    pixels: Arc<Picture>,
    next: Vec<u8>,
    row: u32,
}

impl ImageUpload {
    pub(super) fn new(device: &wgpu::Device, pixels: Arc<Picture>) -> Self {
        let Picture { width, height, .. } = *pixels;
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: width.max(height).ilog2() + 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Self { texture, mip: 0, size: (width, height), pixels, next: Vec::new(), row: 0 }
    }

    /// Uploads a band; gives its bytes, and the image once it is whole.
    pub(super) fn step(&mut self, queue: &wgpu::Queue) -> (u64, Option<wgpu::TextureView>) {
        let (width, height) = self.size;
        // An even number of rows: the next mipmap takes them in pairs.
        let rows = ((STEP_PIXELS / width).max(2) & !1).min(height - self.row);
        let band = &self.pixels.pixels[(self.row * width * 4) as usize..((self.row + rows) * width * 4) as usize];
        let to = wgpu::TexelCopyTextureInfo {
            texture: &self.texture,
            mip_level: self.mip,
            origin: wgpu::Origin3d { x: 0, y: self.row, z: 0 },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * 4), rows_per_image: None };
        queue.write_texture(to, band, layout, wgpu::Extent3d { width, height: rows, depth_or_array_layers: 1 });
        let bytes = band.len() as u64;
        self.row += rows;
        let last = self.row == height;
        let half = (height / 2).max(1);
        let made = self.next.len() as u32 / ((width / 2).max(1) * 4);
        halve_rows(self.size, &self.pixels.pixels, made..if last { half } else { (self.row / 2).min(half) }, &mut self.next);
        if !last {
            return (bytes, None);
        }
        if self.size == (1, 1) {
            return (bytes, Some(self.texture.create_view(&Default::default())));
        }
        self.mip += 1;
        self.size = ((width / 2).max(1), half);
        self.pixels = Arc::new(Picture { width: self.size.0, height: half, pixels: std::mem::take(&mut self.next) });
        self.row = 0;
        (bytes, None)
    }
}

/// A picture that fits a texture here: halved until it does.
pub(super) fn fitting(picture: &Arc<Picture>, side: u32) -> Arc<Picture> {
    let mut fits = picture.clone();
    while fits.width.max(fits.height) > side {
        let (width, height) = ((fits.width / 2).max(1), (fits.height / 2).max(1));
        let mut pixels = Vec::with_capacity(width as usize * height as usize * 4);
        halve_rows((fits.width, fits.height), &fits.pixels, 0..height, &mut pixels);
        fits = Arc::new(Picture { width, height, pixels });
    }
    fits
}

/// One white pixel, for models without an image.
pub(super) fn white(device: &wgpu::Device, queue: &wgpu::Queue) -> wgpu::TextureView {
    let mut upload = ImageUpload::new(device, Arc::new(Picture { width: 1, height: 1, pixels: vec![255; 4] }));
    loop {
        if let (_, Some(view)) = upload.step(queue) {
            return view;
        }
    }
}
