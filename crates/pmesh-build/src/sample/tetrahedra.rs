//! GV99's Figure 11: four tetrahedra meeting at their corners, again and again; non-manifold at every joint.

use crate::cluster::Clustering;
use pmesh_core::{IndexedMesh, Vertices};
use std::collections::HashMap;

const CORNERS: [[f32; 3]; 4] = [[0., 0., 0.], [2., 2., 0.], [2., 0., 2.], [0., 2., 2.]];

/// The model after `depth` subdivisions: 4 × 4^depth triangles (4, 16, 64), volume 8/3 / 2^depth.
pub fn sierpinski(depth: u32) -> IndexedMesh {
    let mut tetrahedra = vec![CORNERS];
    for _ in 0..depth {
        let split = |t: &[[f32; 3]; 4]| -> Vec<[[f32; 3]; 4]> {
            let middle = |a: [f32; 3], b: [f32; 3]| std::array::from_fn(|k| (a[k] + b[k]) / 2.0);
            (0..4).map(|i| std::array::from_fn(|j| middle(t[i], t[j]))).collect()
        };
        tetrahedra = tetrahedra.iter().flat_map(split).collect();
    }
    let mut mesh = IndexedMesh::default();
    let mut index: HashMap<[u32; 3], u32> = HashMap::new();
    for t in tetrahedra {
        let v = t.map(|p| {
            *index.entry(p.map(f32::to_bits)).or_insert_with(|| {
                mesh.vertices.positions.push(p);
                mesh.vertices.positions.len() as u32 - 1
            })
        });
        // Outward, as Figure 13's coarsest level runs.
        mesh.triangles.extend([[v[0], v[1], v[2]], [v[2], v[1], v[3]], [v[3], v[0], v[2]], [v[1], v[0], v[3]]]);
    }
    mesh
}

/// The clusterings that lead from [`sierpinski`]`(depth)` back to a single tetrahedron: each small tetrahedron's corners go to
/// the corner of the larger one that it sits at.
pub fn sierpinski_steps(depth: u32) -> Vec<Clustering> {
    (1..=depth)
        .rev()
        .map(|d| {
            let (fine, coarse) = (sierpinski(d), sierpinski(d - 1));
            let find = |p: [f32; 3]| nearest(&coarse.vertices, p);
            let map = fine.vertices.positions.iter().map(|&p| find(p)).collect();
            Clustering { vertices: coarse.vertices, map }
        })
        .collect()
}

/// A vertex that is a corner of the coarser mesh stays; a midpoint goes to the end that its edge's order names first.
fn nearest(coarse: &Vertices, p: [f32; 3]) -> u32 {
    let distance = |q: &[f32; 3]| -> f32 { (0..3).map(|k| (p[k] - q[k]).powi(2)).sum() };
    let best = coarse.positions.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
    best.map_or(0, |(i, _)| i as u32)
}
