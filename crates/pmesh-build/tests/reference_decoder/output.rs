//! Section 8: from rows to floats.

use super::Mesh;
use super::frame::Header;

/// What the blocks that were decoded give (8.2).
#[derive(Debug, Default)]
pub struct Decoded {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub colors: Vec<[f32; 4]>,
    pub texcoords: Vec<[f32; 2]>,
    pub triangles: Vec<[u32; 3]>,
    pub seams: Vec<(u32, u32)>,
    /// (vertex of a level, its representative).
    pub representatives: Vec<(u32, u32)>,
}

impl Decoded {
    /// Whether all floats are.
    pub fn is_finite(&self) -> bool {
        let vectors = self.positions.as_flattened().iter().chain(self.normals.as_flattened());
        vectors.chain(self.colors.as_flattened()).chain(self.texcoords.as_flattened()).all(|x| x.is_finite())
    }
}

fn exact(i: i32) -> f32 {
    f32::from_bits(if i >= 0 { i } else { i ^ 0x7fff_ffff } as u32)
}

fn position(h: &Header, shift: u32, q: [i32; 3]) -> [f32; 3] {
    if h.position_bits == 0 {
        return q.map(exact);
    }
    let z = f64::from(1u32 << shift);
    [0, 1, 2].map(|k| {
        let y = f64::from(q[k]) * z + 0.5 * (z - 1.0);
        (f64::from(h.origin[k]) + y * h.step) as f32
    })
}

fn normal(h: &Header, q: &[i32]) -> [f32; 3] {
    if h.normal_bits == 0 {
        return [exact(q[0]), exact(q[1]), exact(q[2])];
    }
    let half = f64::from((1u32 << (h.normal_bits - 1)) - 1);
    let (u, v) = (f64::from(q[0]) / half - 1.0, f64::from(q[1]) / half - 1.0);
    let z = 1.0 - u.abs() - v.abs();
    let t = (-z).max(0.0);
    let (x, y) = (u - t.copysign(u), v - t.copysign(v));
    let l = (x * x + y * y + z * z).sqrt();
    [(x / l) as f32, (y / l) as f32, (z / l) as f32]
}

fn color(h: &Header, q: i32) -> f32 {
    if h.color_bits == 0 { exact(q) } else { q as f32 / ((1u32 << h.color_bits) - 1) as f32 }
}

fn texcoord(h: &Header, k: usize, q: i32) -> f32 {
    if h.texcoord_bits == 0 {
        return exact(q);
    }
    (f64::from(h.texcoord_origin[k]) + f64::from(q) * h.texcoord_step) as f32
}

pub fn output(h: &Header, mesh: &Mesh) -> Decoded {
    let pairs = |list: &[(usize, usize)]| list.iter().map(|&(a, b)| (a as u32, b as u32)).collect();
    let mut out = Decoded {
        triangles: mesh.triangles.iter().map(|t| t.map(|v| v as u32)).collect(),
        seams: pairs(&mesh.seams),
        representatives: pairs(&mesh.representatives),
        ..Default::default()
    };
    for row in &mesh.rows {
        out.positions.push(position(h, mesh.shift, [row[0], row[1], row[2]]));
        let mut at = 3;
        if h.normals {
            out.normals.push(normal(h, &row[at..]));
            at += if h.normal_bits == 0 { 3 } else { 2 };
        }
        if h.colors {
            out.colors.push([0, 1, 2, 3].map(|k| color(h, row[at + k])));
            at += 4;
        }
        if h.texcoords {
            out.texcoords.push([0, 1].map(|k| texcoord(h, k, row[at + k])));
        }
    }
    out
}
