//! What a node says of all that lies below it: how far it reaches, where it faces, how far off it is.

/// Lengths an octave.
const STEPS_AN_OCTAVE: u32 = 4;
/// 2^(k / 4), written out: the same on every platform.
pub(super) const ROOTS: [f64; STEPS_AN_OCTAVE as usize] =
    [1.0, 1.189_207_115_002_721, std::f64::consts::SQRT_2, 1.681_792_830_507_429];
/// The lengths of all codes, in units.
static LENGTHS: [f64; 256] = {
    let mut all = [0.0; 256];
    let mut code = 1;
    while code < 256 {
        let below = 255 - code as u32;
        let octaves = below.div_ceil(STEPS_AN_OCTAVE);
        all[code] = ROOTS[(octaves * STEPS_AN_OCTAVE - below) as usize] / (1u128 << octaves) as f64;
        code += 1;
    }
    all
};
/// Steps of an axis's coordinate from 0 to 1. Few: views ask little of it, and each costs bits.
const AXIS_STEPS: f64 = 10.0;
/// Sines of half the angle of a cone, by their code.
const SINES: [f64; Bounds::NO_CONE as usize] = [0.25, 0.5, 0.75, 0.97];

/// Bounds of a node in six bytes. Both ends compute with these, so both decide alike; each length is rounded up.
///
/// A length `b` is `unit · 2^((b − 255) / 4)`, 0 is 0: of the unit, which both ends know, down to 2^-63.5.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Bounds {
    /// Radius of a ball about the node's vertex with all triangles at the vertices below it. Odd: of these every other length does.
    pub radius: u8,
    /// How far those vertices are from the surface, along it, at most; without a cone whichever way. Not less than [`Self::least_uniform`].
    pub uniform: u8,
    /// How far they are from it along the axis, at most; 0 without a cone.
    pub directional: u8,
    /// Axis of a cone with the normals of all those triangles, on an octahedron: −10 to 10.
    pub axis: [i8; 2],
    /// Half the cone's angle, of which [`Self::sine`] gives the sine; [`Self::NO_CONE`]: they face any way.
    pub angle: u8,
}

impl Bounds {
    /// What [`Self::angle`] is without a cone.
    pub const NO_CONE: u8 = 4;

    /// The six bytes.
    pub fn to_bytes(&self) -> [u8; 6] {
        [self.radius, self.uniform, self.directional, self.axis[0] as u8, self.axis[1] as u8, self.angle]
    }
    /// From six bytes.
    pub fn from_bytes([radius, uniform, directional, x, y, angle]: [u8; 6]) -> Self {
        Self { radius, uniform, directional, axis: [x as i8, y as i8], angle }
    }
    /// True of a leaf of the whole hierarchy: nothing lies below it, so nothing is off.
    pub fn is_leaf(&self) -> bool {
        self.uniform == 0 && self.directional == 0
    }
    /// What `uniform` is at least beside an error along the axis: half of that. Less shows only to who looks along the axis, and costs bits.
    pub fn least_uniform(directional: u8) -> u8 {
        directional.saturating_sub(STEPS_AN_OCTAVE as u8).max(1)
    }
    /// Sine of half the cone's angle, if there is a cone.
    pub fn sine(&self) -> Option<f64> {
        SINES.get(self.angle as usize).copied()
    }
    /// The code of a cone of that sine or the next wider one.
    pub fn angle_code(sine: f64) -> u8 {
        SINES.iter().position(|&s| sine <= s).map_or(Self::NO_CONE, |i| i as u8)
    }
    /// The code of a length, rounded up.
    pub fn length_code(length: f64, unit: f64) -> u8 {
        if length.is_nan() || length <= 0.0 {
            return 0;
        }
        // The codes ascend.
        let (mut low, mut high) = (1u8, 255u8);
        while low < high {
            let middle = low.midpoint(high);
            if Self::length(middle, unit) >= length { high = middle } else { low = middle + 1 }
        }
        low
    }
    /// The length of a code.
    #[inline]
    pub fn length(code: u8, unit: f64) -> f64 {
        unit * LENGTHS[code as usize]
    }
    /// The axis as a unit vector.
    pub fn direction(&self) -> [f64; 3] {
        let [x, y] = self.axis.map(|a| f64::from(a.clamp(-10, 10)) / AXIS_STEPS);
        let z = 1.0 - x.abs() - y.abs();
        let fold = (-z).max(0.0);
        let v = [x - fold.copysign(x), y - fold.copysign(y), z];
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        v.map(|c| c / length.max(1e-9))
    }
    /// Codes of the axis nearest to `n`; of no vector that of +z.
    pub fn axis_code(n: [f64; 3]) -> [i8; 2] {
        let sum: f64 = n.iter().map(|c| c.abs()).sum();
        if sum.is_nan() || sum <= 0.0 {
            return [0, 0];
        }
        let [x, y, z] = n.map(|c| c / sum);
        let (x, y) = if z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
        [x, y].map(|c| (c * AXIS_STEPS).round() as i8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_rounded_up_by_a_fifth_at_most() {
        for i in 0..2000 {
            let length = 1e-12 * 1.0137f64.powi(i);
            if length > 0.9 {
                break;
            }
            let code = Bounds::length_code(length, 1.0);
            let back = Bounds::length(code, 1.0);
            assert!(back >= length && back <= length * 1.19, "{length} {code} {back}");
        }
        assert_eq!(Bounds::length_code(0.0, 1.0), 0);
        assert_eq!(Bounds::length(255, 3.0), 3.0);
        assert!((1..255).all(|c| Bounds::length(c, 1.0) < Bounds::length(c + 1, 1.0)));
    }

    #[test]
    fn axes_come_back_within_eleven_degrees() {
        for i in 0..500 {
            let (a, z) = (f64::from(i) * 2.4, f64::from(i) / 249.5 - 1.0);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = [r * a.cos(), r * a.sin(), z];
            let back = Bounds { axis: Bounds::axis_code(n), ..Default::default() }.direction();
            let dot: f64 = n.iter().zip(back).map(|(a, b)| a * b).sum();
            assert!(dot > 0.9816, "{n:?} {back:?}");
        }
    }
}
