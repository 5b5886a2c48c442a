//! Vertices as the texels that the vertex shader reads, and images with their mipmaps. Plain bytes; no GPU here.

/// Bytes of a texel of the vertex texture: three coordinates and a colour.
pub const VERTEX_TEXEL: usize = 16;

/// Position and colour of a vertex; colour 8 bits a channel, red lowest.
pub fn vertex(position: [f32; 3], color: Option<[f32; 4]>) -> [u32; 4] {
    let [x, y, z] = position.map(f32::to_bits);
    let bytes = color.unwrap_or([1.0; 4]).map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
    [x, y, z, u32::from_le_bytes(bytes)]
}

/// A unit normal on the octahedral map, 16 bits a component. 0 means "none": the square's corner, which no unit normal
/// but (0, 0, -1) maps to; that one goes to another corner.
pub fn normal([x, y, z]: [f32; 3]) -> u32 {
    let l = x.abs() + y.abs() + z.abs();
    if l == 0.0 || !l.is_finite() {
        return 0;
    }
    let (x, y) = (x / l, y / l);
    let sign = |a: f32| if a < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = if z < 0.0 { ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)) } else { (x, y) };
    let [u, v] = [u, v].map(|a| ((a + 1.0) * 32767.0 + 0.5) as u32);
    match v << 16 | u {
        0 => 65534,
        packed => packed,
    }
}

/// Mipmaps of an RGBA image with 8 bits a channel, each half the one before, the first included.
pub fn mipmaps(width: u32, height: u32, pixels: Vec<u8>) -> Vec<(u32, u32, Vec<u8>)> {
    let mut levels = vec![(width, height, pixels)];
    while let Some((w, h, from)) = levels.last().filter(|l| l.0 > 1 || l.1 > 1) {
        let (w, h) = (*w, *h);
        let (nw, nh) = ((w / 2).max(1), (h / 2).max(1));
        let mut to = Vec::with_capacity((nw * nh * 4) as usize);
        for y in 0..nh {
            for x in 0..nw {
                for c in 0..4 {
                    let at = |dx: u32, dy: u32| {
                        let (x, y) = ((2 * x + dx).min(w - 1), (2 * y + dy).min(h - 1));
                        u32::from(from[((y * w + x) * 4 + c) as usize])
                    };
                    to.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
                }
            }
        }
        levels.push((nw, nh, to));
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_normal_is_mistaken_for_none() {
        for i in 0..10_000 {
            let (a, b) = (i as f32 * 0.1, i as f32 * 0.0337);
            let n = [a.cos() * b.cos(), a.sin() * b.cos(), b.sin()];
            assert_ne!(normal(n), 0);
        }
        for n in [[0.0, 0.0, -1.0], [-0.0, -0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]] {
            assert_ne!(normal(n), 0, "{n:?}");
        }
        assert_eq!(normal([0.0; 3]), 0);
    }

    #[test]
    fn mipmaps_end_at_one_pixel_and_keep_the_mean() {
        let levels = mipmaps(4, 2, (0..32).map(|i| if i % 8 < 4 { 0 } else { 200 }).collect());
        assert_eq!(levels.iter().map(|l| (l.0, l.1)).collect::<Vec<_>>(), [(4, 2), (2, 1), (1, 1)]);
        assert_eq!(levels[2].2, [100; 4]);
    }
}
