//! Fractal value noise in space: the same numbers on every platform (no libm in the lattice).

fn lattice(x: i32, y: i32, z: i32) -> f64 {
    let mut h =
        (x as u32).wrapping_mul(0x8da6_b343) ^ (y as u32).wrapping_mul(0xd816_3841) ^ (z as u32).wrapping_mul(0xcb1a_b31f);
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    f64::from(h ^ (h >> 16)) / f64::from(u32::MAX) * 2.0 - 1.0
}

/// Smooth noise in -1 to 1, features of size 1.
pub(super) fn noise(p: [f64; 3]) -> f64 {
    let cell = p.map(f64::floor);
    let [x, y, z] = cell.map(|c| c as i32);
    let t: [f64; 3] = std::array::from_fn(|k| {
        let f = p[k] - cell[k];
        f * f * (3.0 - 2.0 * f)
    });
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let along_x = |j: i32, k: i32| mix(lattice(x, y + j, z + k), lattice(x + 1, y + j, z + k), t[0]);
    mix(mix(along_x(0, 0), along_x(1, 0), t[1]), mix(along_x(0, 1), along_x(1, 1), t[1]), t[2])
}

/// Octaves of [`noise`], each twice as fine and half as strong.
pub(super) fn fractal(p: [f64; 3], octaves: u32) -> f64 {
    (0..octaves).map(|o| noise(p.map(|x| x * f64::from(1 << o) + f64::from(o) * 17.3)) / f64::from(1 << o)).sum()
}
