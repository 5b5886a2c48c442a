//! Meshes that are a grid: height maps, above all. Coordinates of their vertices, found from connectivity alone.

use pmesh_core::surface::{NONE, Surface, next, previous};
use std::collections::VecDeque;

/// Part of the vertices that one grid must reach.
const LEAST_PART: f64 = 0.9;

/// Directions about a vertex of six neighbours, counter-clockwise.
const DIRECTIONS: [[i32; 2]; 6] = [[1, 0], [1, 1], [0, 1], [-1, 0], [-1, -1], [0, -1]];

/// Where each vertex stands in the grid that holds most of the mesh, if one does. O(triangles).
pub(super) fn coordinates(surface: &Surface, count: &[u32]) -> Option<Vec<Option<[i32; 2]>>> {
    let n = surface.corner_of.len();
    let used = count.iter().filter(|&&c| c > 0).count();
    let regular = |v: usize| count[v] == 6;
    if (0..n).filter(|&v| regular(v)).count() as f64 <= LEAST_PART * used as f64 {
        return None;
    }
    let mut places: Vec<Option<[i32; 2]>> = vec![None; n];
    let mut found = 0;
    // The middle of the mesh in its own order is a good place to begin: a border is not.
    let seed = (n / 2..n).chain(0..n / 2).find(|&v| regular(v) && closed(surface, v))?;
    places[seed] = Some([0, 0]);
    // Corners of regular vertices, and the direction of the edge that begins there.
    let mut queue = VecDeque::from([(surface.corner_of[seed], 0usize)]);
    while let Some((start, first)) = queue.pop_front() {
        let Some([i, j]) = places[surface.vertex(start) as usize] else { continue };
        let mut c = start;
        for k in 0..6 {
            let direction = (first + k) % 6;
            let [x, y] = DIRECTIONS[direction];
            let v = surface.vertex(next(c)) as usize;
            if places[v].is_none() {
                places[v] = Some([i + x, j + y]);
                found += 1;
                if regular(v) && closed(surface, v) {
                    // Its edge back has the opposite direction.
                    let back = surface.across[c as usize];
                    if back != NONE {
                        queue.push_back((back, (direction + 3) % 6));
                    }
                }
            }
            c = surface.turn(c);
            if c == NONE {
                break;
            }
        }
    }
    (f64::from(found) >= LEAST_PART * used as f64).then_some(places)
}

fn closed(surface: &Surface, v: usize) -> bool {
    let start = surface.corner_of[v];
    start != NONE && surface.around(start).all(|c| surface.turn(c) != NONE && surface.vertex(previous(c)) != v as u32)
}
