//! GV99's Figure 11: four tetrahedra meeting at their corners, again and again; non-manifold at every joint.

use crate::cluster::Clustering;
use pmesh_core::IndexedMesh;
use std::collections::HashMap;

const CORNERS: [[f32; 3]; 4] = [[0., 0., 0.], [2., 2., 0.], [2., 0., 2.], [0., 2., 2.]];

type Point = [f32; 3];

fn middle(a: Point, b: Point) -> Point {
    std::array::from_fn(|k| (a[k] + b[k]) / 2.0)
}

fn tetrahedra(depth: u32) -> Vec<[Point; 4]> {
    let split = |t: &[Point; 4]| -> [[Point; 4]; 4] {
        let t = *t;
        std::array::from_fn(|i| std::array::from_fn(|j| middle(t[i], t[j])))
    };
    (0..depth).fold(vec![CORNERS], |all, _| all.iter().flat_map(split).collect())
}

/// The model after `depth` subdivisions: 4 × 4^depth triangles (4, 16, 64), volume 8/3 / 2^depth.
pub fn sierpinski(depth: u32) -> IndexedMesh {
    let mut mesh = IndexedMesh::default();
    let mut index: HashMap<[u32; 3], u32> = HashMap::new();
    for t in tetrahedra(depth) {
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

/// The end of each edge (i, j) of a tetrahedron that its midpoint is mapped to: the small tetrahedron at corner 0 grows to
/// the large one (Figure 13's representatives 4 -> 1, 5 -> 2, 6 -> 3), and none of the other three keeps a face.
const ENDS: [(usize, usize, usize); 6] = [(0, 1, 1), (0, 2, 2), (0, 3, 3), (1, 2, 1), (2, 3, 2), (1, 3, 3)];

/// The clusterings that lead from [`sierpinski`]`(depth)` back to a single tetrahedron.
pub fn sierpinski_steps(depth: u32) -> Vec<Clustering> {
    let step = |d: u32| {
        let (fine, coarse) = (sierpinski(d), sierpinski(d - 1));
        let bits = |p: Point| p.map(f32::to_bits);
        let index = |mesh: &IndexedMesh| -> HashMap<[u32; 3], u32> {
            mesh.vertices.positions.iter().enumerate().map(|(i, &p)| (bits(p), i as u32)).collect()
        };
        let of_coarse = index(&coarse);
        let mut target: HashMap<[u32; 3], u32> = of_coarse.clone();
        for t in tetrahedra(d - 1) {
            for (i, j, end) in ENDS {
                target.insert(bits(middle(t[i], t[j])), of_coarse[&bits(t[end])]);
            }
        }
        let map = fine.vertices.positions.iter().map(|&p| target[&bits(p)]).collect();
        Clustering { vertices: coarse.vertices, map }
    };
    (1..=depth).rev().map(step).collect()
}
