//! Vertices as rows of integers, and back: what quantisation does to positions and attributes, and nothing else.
//!
//! Where a channel is not quantised its integer is the float's bits, mapped so that order is kept: close floats give
//! close integers, every bit survives, the sign of zero too.

use pmesh_core::{AttributeSet, IndexedMesh, Vertices};

/// Grids of a stream. `bits` of `None` means exact floats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quantisation {
    /// Bits a coordinate, 8 to 16.
    pub position_bits: Option<u8>,
    /// Minimum corner of the bounding box.
    pub position_origin: [f32; 3],
    /// Longest side of the bounding box / (2^bits - 1), as Draco's.
    pub position_step: f64,
    /// Bits a component of the octahedral map, 4 to 16.
    pub normal_bits: Option<u8>,
    /// Bits a colour channel over 0 to 1, 1 to 16.
    pub color_bits: Option<u8>,
    /// Bits a texture coordinate, 4 to 20.
    pub texcoord_bits: Option<u8>,
    /// Smallest u and v.
    pub texcoord_origin: [f32; 2],
    /// Longest side of the (u, v) box / (2^bits - 1).
    pub texcoord_step: f64,
}

fn span<const N: usize>(values: &[[f32; N]], bits: u8) -> ([f32; N], f64) {
    let mut low = [f32::INFINITY; N];
    let mut high = [f32::NEG_INFINITY; N];
    for v in values {
        (0..N).for_each(|k| (low[k], high[k]) = (low[k].min(v[k]), high[k].max(v[k])));
    }
    if values.is_empty() {
        return ([0.0; N], 1.0);
    }
    let longest = (0..N).map(|k| f64::from(high[k]) - f64::from(low[k])).fold(0.0, f64::max);
    // A model without extent still needs a step that divides.
    let step = if longest > 0.0 { longest / f64::from((1u32 << bits) - 1) } else { 1.0 };
    (low, step)
}

impl Quantisation {
    /// Grids for `vertices`: positions at `bits`, attributes at precisions to match (normals 10, colours 8, texture
    /// coordinates max(bits, 12)); `None` keeps every float.
    pub fn fit(vertices: &Vertices, bits: Option<u8>) -> Self {
        let Some(bits) = bits else { return Self::default() };
        let texcoord_bits = bits.max(12);
        let (position_origin, position_step) = span(&vertices.positions, bits);
        let (texcoord_origin, texcoord_step) = span(&vertices.attributes.texcoords, texcoord_bits);
        Self {
            position_bits: Some(bits),
            position_origin,
            position_step,
            normal_bits: Some(10),
            color_bits: Some(8),
            texcoord_bits: Some(texcoord_bits),
            texcoord_origin,
            texcoord_step,
        }
    }
    /// A position as whole steps of the grid; without one, as integers in the order of the floats.
    pub fn position_row(&self, p: [f32; 3]) -> [i32; 3] {
        match self.position_bits {
            Some(_) => std::array::from_fn(|k| to_grid(p[k], self.position_origin[k], self.position_step)),
            None => p.map(from_float),
        }
    }
    /// The position of such a row.
    pub fn position_of_row(&self, row: [i32; 3]) -> [f32; 3] {
        match self.position_bits {
            Some(_) => std::array::from_fn(|k| from_grid(row[k].into(), self.position_origin[k], self.position_step)),
            None => row.map(to_float),
        }
    }
}

/// `mesh` as it decodes after quantisation with `bits`: the same indices, every value on its grid.
pub fn quantise(mesh: &IndexedMesh, bits: Option<u8>) -> IndexedMesh {
    let channels = Channels::new(mesh.vertices.set(), Quantisation::fit(&mesh.vertices, bits));
    let mut vertices = Vertices::default();
    let mut row = Vec::new();
    for i in 0..mesh.vertices.len() {
        row.clear();
        channels.row(&mesh.vertices, i, &mut row);
        channels.push(&row, 0, &mut vertices);
    }
    IndexedMesh { vertices, triangles: mesh.triangles.clone(), position_of: mesh.position_of.clone() }
}

fn from_float(x: f32) -> i32 {
    let bits = x.to_bits() as i32;
    if bits < 0 { bits ^ i32::MAX } else { bits }
}
fn to_float(i: i32) -> f32 {
    f32::from_bits((if i < 0 { i ^ i32::MAX } else { i }) as u32)
}
fn to_grid(x: f32, origin: f32, step: f64) -> i32 {
    ((f64::from(x) - f64::from(origin)) / step).round() as i32
}
fn from_grid(q: f64, origin: f32, step: f64) -> f32 {
    (f64::from(origin) + q * step) as f32
}

/// Octahedral map (Meyer et al. 2010): the unit sphere to the square, both components 0 to 2^bits - 2, so that the axes
/// lie on the grid.
fn to_octahedron(n: [f32; 3], bits: u8) -> [i32; 2] {
    let [x, y, z] = n.map(f64::from);
    let l = x.abs() + y.abs() + z.abs();
    let (x, y) = if l > 0.0 { (x / l, y / l) } else { (0.0, 0.0) };
    let sign = |a: f64| if a < 0.0 { -1.0 } else { 1.0 };
    let (u, v) = if z < 0.0 { ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)) } else { (x, y) };
    let half = f64::from((1u32 << (bits - 1)) - 1);
    [u, v].map(|a| ((a + 1.0) * half).round() as i32)
}
fn from_octahedron(q: [i32; 2], bits: u8) -> [f32; 3] {
    let half = f64::from((1u32 << (bits - 1)) - 1);
    let [u, v] = q.map(|a| f64::from(a) / half - 1.0);
    let z = 1.0 - u.abs() - v.abs();
    let fold = (-z).max(0.0);
    let (x, y) = (u - fold.copysign(u), v - fold.copysign(v));
    let l = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|a| (a / l) as f32)
}

/// The rows of one stream.
#[derive(Clone, Debug, Default)]
pub(crate) struct Channels {
    set: AttributeSet,
    grids: Quantisation,
}

impl Channels {
    pub(crate) fn new(set: AttributeSet, grids: Quantisation) -> Self {
        Self { set, grids }
    }
    /// Integers a vertex; the first three are the position.
    pub(crate) fn count(&self) -> usize {
        let normals = if self.grids.normal_bits.is_some() { 2 } else { 3 };
        3 + if self.set.normals { normals } else { 0 }
            + if self.set.colors { 4 } else { 0 }
            + if self.set.texcoords { 2 } else { 0 }
    }
    /// Appends the row of vertex `i`.
    pub(crate) fn row(&self, vertices: &Vertices, i: usize, row: &mut Vec<i32>) {
        let g = &self.grids;
        let p = vertices.positions[i];
        match g.position_bits {
            Some(_) => row.extend((0..3).map(|k| to_grid(p[k], g.position_origin[k], g.position_step))),
            None => row.extend(p.map(from_float)),
        }
        let a = &vertices.attributes;
        if self.set.normals {
            match g.normal_bits {
                Some(bits) => row.extend(to_octahedron(a.normals[i], bits)),
                None => row.extend(a.normals[i].map(from_float)),
            }
        }
        if self.set.colors {
            let c = a.colors[i];
            match g.color_bits {
                Some(bits) => row.extend(c.map(|x| (x.clamp(0.0, 1.0) * ((1u32 << bits) - 1) as f32).round() as i32)),
                None => row.extend(c.map(from_float)),
            }
        }
        if self.set.texcoords {
            let t = a.texcoords[i];
            match g.texcoord_bits {
                Some(_) => row.extend((0..2).map(|k| to_grid(t[k], g.texcoord_origin[k], g.texcoord_step))),
                None => row.extend(t.map(from_float)),
            }
        }
    }
    /// Appends the vertex that `row` stands for. The lowest `shift` bits of its coordinates are not known: it stands in the middle of what
    /// they can be.
    pub(crate) fn push(&self, row: &[i32], shift: u32, out: &mut Vertices) {
        let g = &self.grids;
        let scale = f64::from(1u32 << shift);
        let middle = |q: i32| f64::from(q) * scale + 0.5 * (scale - 1.0);
        out.positions.push(match g.position_bits {
            Some(_) => std::array::from_fn(|k| from_grid(middle(row[k]), g.position_origin[k], g.position_step)),
            None => std::array::from_fn(|k| to_float(row[k])),
        });
        let mut rest = &row[3..];
        let mut take = |n: usize| {
            let (head, tail) = rest.split_at(n);
            rest = tail;
            head
        };
        if self.set.normals {
            out.attributes.normals.push(match g.normal_bits {
                Some(bits) => {
                    let q = take(2);
                    from_octahedron([q[0], q[1]], bits)
                }
                None => std::array::from_fn(|_| to_float(take(1)[0])),
            });
        }
        if self.set.colors {
            let q = take(4);
            out.attributes.colors.push(match g.color_bits {
                Some(bits) => std::array::from_fn(|k| q[k] as f32 / ((1u32 << bits) - 1) as f32),
                None => std::array::from_fn(|k| to_float(q[k])),
            });
        }
        if self.set.texcoords {
            let q = take(2);
            out.attributes.texcoords.push(match g.texcoord_bits {
                Some(_) => std::array::from_fn(|k| from_grid(f64::from(q[k]), g.texcoord_origin[k], g.texcoord_step)),
                None => std::array::from_fn(|k| to_float(q[k])),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn floats_survive_bit_for_bit_and_keep_their_order(a in any::<f32>(), b in any::<f32>()) {
            prop_assume!(!a.is_nan() && !b.is_nan());
            prop_assert_eq!(to_float(from_float(a)).to_bits(), a.to_bits());
            if a < b { prop_assert!(from_float(a) < from_float(b)); }
        }
        #[test]
        fn quantising_twice_changes_nothing(n in prop::array::uniform3(-1.0f32..1.0), bits in 4u8..=16) {
            prop_assume!(n.iter().any(|x| x.abs() > 1e-3));
            let once = from_octahedron(to_octahedron(n, bits), bits);
            prop_assert_eq!(from_octahedron(to_octahedron(once, bits), bits), once);
        }
    }
}
