//! Built-in models, made by code: the gallery, the tests and whoever has no mesh at hand use them.

mod noise;
mod shapes;
mod tetrahedra;

use crate::cluster::levels_from_clusterings;
use crate::import::{Model, link_seams};
use pmesh_codec::pmesh::LevelStream;
pub use shapes::{globe, knot, marble, part};
pub use tetrahedra::{sierpinski, sierpinski_steps};

/// Name and one line about each sample.
pub const SAMPLES: [(&str, &str); 5] = [
    ("globe", "a textured globe with fractal relief: texture coordinates, a seam, 80,000 triangles"),
    ("marble", "a turned marble body: vertex colours, 50,000 triangles"),
    ("tetrahedra", "the non-manifold model of GV99's Figure 11: 64, 16 and 4 triangles"),
    ("knot", "a trefoil knot: smooth, closed, 48,000 triangles"),
    ("part", "a machined part: sharp edges, flat faces, 12,000 triangles"),
];

/// The levels of a sample that has its own, which no simplifier would find: the clusterings of Figure 11's model.
pub fn sample_levels(name: &str) -> Option<LevelStream> {
    if name != "tetrahedra" {
        return None;
    }
    let steps = sierpinski_steps(2);
    // Both fit, being made by the same code.
    let levels = levels_from_clusterings(&sierpinski(2), &steps).ok()?;
    // A midpoint lies half an edge from the corner that stands for it; edges of 2√2, halved level by level.
    let edge = 8f32.sqrt();
    Some(LevelStream { levels, errors: vec![edge / 2.0, edge / 4.0, 0.0], ..Default::default() })
}

/// Makes a sample by name; `None` if there is none of that name.
pub fn sample(name: &str) -> Option<Model> {
    let mut model = match name {
        "globe" => globe(200),
        "marble" => Model { mesh: marble(250, 100), ..Default::default() },
        "tetrahedra" => Model { mesh: sierpinski(2), ..Default::default() },
        "knot" => Model { mesh: knot(600, 40), ..Default::default() },
        "part" => Model { mesh: part(), ..Default::default() },
        _ => return None,
    };
    link_seams(&mut model.mesh);
    Some(model)
}
