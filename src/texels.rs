//! Vertices as the texels that the vertex shader reads, and images at half their size. Plain bytes; no GPU here.

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

/// Rows `rows` of an RGBA image (8 bits a channel) at half its size, appended to `out`. Odd sizes repeat their last pixel.
pub fn halve_rows(size: (u32, u32), from: &[u8], rows: std::ops::Range<u32>, out: &mut Vec<u8>) {
    let (w, h) = size;
    for y in rows {
        for x in 0..(w / 2).max(1) {
            for c in 0..4 {
                let at = |dx: u32, dy: u32| {
                    let (x, y) = ((2 * x + dx).min(w - 1), (2 * y + dy).min(h - 1));
                    u32::from(from[((y * w + x) * 4 + c) as usize])
                };
                out.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4) as u8);
            }
        }
    }
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
    fn halving_keeps_the_mean() {
        let image: Vec<u8> = (0..32).map(|i| if i % 8 < 4 { 0 } else { 200 }).collect();
        let mut half = Vec::new();
        halve_rows((4, 2), &image, 0..1, &mut half);
        assert_eq!(half, [100; 8]);
        let mut one = Vec::new();
        halve_rows((2, 1), &half, 0..1, &mut one);
        assert_eq!(one, [100; 4]);
    }
}
