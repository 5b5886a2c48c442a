//! What tests have in common.

use pmesh_core::{IndexedMesh, Vertices};
use proptest::prelude::*;

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
