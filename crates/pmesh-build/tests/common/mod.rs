//! What tests have in common.
#![allow(dead_code, reason = "each test file uses some of it")]

use pmesh_core::{IndexedMesh, ProgressiveMultilevelMesh, Vertices};
use proptest::prelude::*;
use std::collections::HashMap;

/// Any triangles: what cannot be taken apart stays in the base, and comes back.
pub fn soup() -> impl Strategy<Value = IndexedMesh> {
    let position = (0i8..9, 0i8..9, 0i8..4).prop_map(|(x, y, z)| [f32::from(x), f32::from(y), f32::from(z)]);
    prop::collection::vec(position, 1..30).prop_flat_map(|positions| {
        let n = positions.len() as u32;
        prop::collection::vec((0..n, 0..n, 0..n).prop_map(|(a, b, c)| [a, b, c]), 0..90).prop_map(move |triangles| IndexedMesh {
            vertices: Vertices { positions: positions.clone(), ..Default::default() },
            triangles,
            ..Default::default()
        })
    })
}

/// A piece of ground of random heights, holes in it: random costs, so random forests, boundaries among them.
pub fn ground() -> impl Strategy<Value = IndexedMesh> {
    (4u32..14, 4u32..14).prop_flat_map(|(w, h)| {
        let cells = ((w - 1) * (h - 1)) as usize;
        (prop::collection::vec(0i8..100, (w * h) as usize), prop::collection::vec(0u8..12, cells)).prop_map(
            move |(heights, kinds)| {
                let positions = heights.iter().enumerate().map(|(v, &z)| {
                    let v = v as u32;
                    [(v % w) as f32, (v / w) as f32, f32::from(z) * 0.004]
                });
                let mut triangles = Vec::new();
                for (i, kind) in kinds.iter().enumerate() {
                    let (x, y) = (i as u32 % (w - 1), i as u32 / (w - 1));
                    let [a, b, c, d] = [y * w + x, y * w + x + 1, (y + 1) * w + x + 1, (y + 1) * w + x];
                    match kind {
                        0 => {}
                        k if k % 2 == 0 => triangles.extend([[a, b, c], [a, c, d]]),
                        _ => triangles.extend([[a, b, d], [b, c, d]]),
                    }
                }
                let vertices = Vertices { positions: positions.collect(), ..Default::default() };
                IndexedMesh { vertices, triangles, ..Default::default() }
            },
        )
    })
}

/// Every level of a mesh without boundary has none: at each edge, between positions, an even number of triangles. Vertex
/// maps cannot change that, so an odd one is a hole.
pub fn no_level_has_a_hole(mesh: &ProgressiveMultilevelMesh) {
    for level in 0..mesh.level_count() {
        let shown = mesh.mesh_at(level.into()).expect("a level");
        let mut position: Vec<u32> = (0..shown.vertices.len() as u32).collect();
        shown.position_of.iter().for_each(|&(v, p)| position[v as usize] = position[p as usize]);
        let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
        for t in &shown.triangles {
            let t = t.map(|v| position[v as usize]);
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
        let odd = edges.iter().filter(|(edge, count)| edge.0 != edge.1 && **count % 2 == 1).count();
        assert_eq!(odd, 0, "level {level}");
    }
}
