//! One tree: its walk, the cut along it, the triangles that fill the gap.

use pmesh_core::CornerMove;
use pmesh_core::surface::{NONE, Surface, next, previous};

/// A side of the gap: an edge of a triangle that stays, the gap on its right.
#[derive(Clone, Debug)]
pub(super) struct Side {
    /// Corner at which the edge begins.
    pub(super) corner: u32,
    /// Vertex at which it ends, before the cut.
    pub(super) vertex: u32,
    /// First corner of triangles between this side and the next, at `vertex`; clockwise.
    pub(super) first: u32,
    /// How many there are.
    pub(super) count: u32,
    /// True if the mesh ends between this side and the next.
    pub(super) open: bool,
}

/// Walks around the tree that has the marked edge `start`; `None` if that takes more than `limit` sides. O(triangles met).
pub(super) fn walk(surface: &Surface, marked: &[bool], start: u32, limit: usize) -> Option<Vec<Side>> {
    let mut sides = Vec::new();
    let mut corner = start;
    loop {
        let first = next(corner);
        let (mut at, mut count, mut open) = (first, 1, false);
        while !marked[at as usize] {
            at = clockwise(surface, at, &mut open);
            count += 1;
        }
        sides.push(Side { corner, vertex: surface.vertex(first), first, count, open });
        corner = at;
        if corner == start {
            return Some(sides);
        }
        if sides.len() == limit {
            return None;
        }
    }
}

/// The next corner about the same vertex; across the gap in the mesh, if it has one there.
fn clockwise(surface: &Surface, corner: u32, open: &mut bool) -> u32 {
    match surface.turn_back(corner) {
        NONE => {
            *open = true;
            let mut last = corner;
            loop {
                match surface.turn(last) {
                    NONE => return last,
                    c => last = c,
                }
            }
        }
        c => c,
    }
}

/// What a split brings.
#[derive(Debug, Default)]
pub(super) struct Opened {
    /// New vertices with their representatives, in the order of their numbers.
    pub(super) vertices: Vec<(u32, u32)>,
    pub(super) corner_moves: Vec<CornerMove>,
    /// Number of the first new triangle.
    pub(super) first_triangle: u32,
}

/// Cuts the surface open along `sides`: every copy gets its vertex, but for those that keep theirs. Gives each copy's vertex.
pub(super) fn cut(surface: &mut Surface, sides: &[Side], keeps: &[bool], opened: &mut Opened) -> Vec<u32> {
    let mut copies = Vec::with_capacity(sides.len());
    for (side, &keeps) in sides.iter().zip(keeps) {
        if keeps {
            surface.corner_of[side.vertex as usize] = side.first;
            copies.push(side.vertex);
            continue;
        }
        let v = surface.corner_of.len() as u32;
        surface.corner_of.push(side.first);
        opened.vertices.push((v, side.vertex));
        let mut at = side.first;
        for _ in 0..side.count {
            surface.triangles[at as usize / 3][at as usize % 3] = v;
            opened.corner_moves.push(CornerMove { triangle: at / 3, corner: (at % 3) as u8, vertex: v });
            at = clockwise(surface, at, &mut false);
        }
        copies.push(v);
    }
    copies
}

/// Fills the gap: a parser takes the sides one by one and joins the last two to a triangle where `join` says so. `join` gets
/// the places (among the copies) of the triangle's vertices and of the next side's end, and the number of sides it has; what is
/// forced it is not asked. O(sides).
pub(super) fn fill(
    surface: &mut Surface,
    sides: &[Side],
    copies: &[u32],
    mut join: impl FnMut([usize; 4], usize) -> bool,
) -> Result<(), &'static str> {
    let count = sides.len();
    // Each edge on the stack: where it begins and ends among the copies, and its corner. Copy i stands at the end of side i.
    let mut stack: Vec<(usize, usize, u32)> = Vec::new();
    let mut taken = 1;
    let vanishes = |a: usize, b: usize, c: usize| {
        let [a, b, c] = [a, b, c].map(|i| sides[i].vertex);
        a == b || b == c || c == a
    };
    loop {
        let top = stack.len();
        let joins = top >= 2 && {
            let ((a, b, _), (_, c, _)) = (stack[top - 2], stack[top - 1]);
            vanishes(a, b, c) && (taken == count || join([a, b, c, taken], top))
        };
        if joins {
            let (Some((_, c, second)), Some((a, b, first))) = (stack.pop(), stack.pop()) else { break };
            let t = surface.triangles.len() as u32;
            surface.triangles.push([copies[a], copies[c], copies[b]]);
            surface.across.extend([NONE; 3]);
            pair(surface, 3 * t + 1, second);
            pair(surface, 3 * t + 2, first);
            stack.push((a, c, 3 * t));
        } else if taken < count {
            stack.push((taken - 1, taken, sides[taken].corner));
            taken += 1;
        } else {
            break;
        }
    }
    match stack[..] {
        [(_, _, last)] => {
            pair(surface, last, sides[0].corner);
            Ok(())
        }
        _ => Err("triangles that do not fill the gap"),
    }
}

fn pair(surface: &mut Surface, a: u32, b: u32) {
    surface.across[a as usize] = b;
    surface.across[b as usize] = a;
}

/// What the triangles of a vertex are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Star {
    /// One fan, closed.
    Closed,
    /// One fan that ends at the boundary.
    Open,
    /// None, or more than one fan: walks about the vertex miss some, so no tree goes there.
    Broken,
}

/// The star of a vertex that has `incident` triangles.
pub(super) fn star(surface: &Surface, v: u32, incident: u32) -> Star {
    let start = surface.corner_of[v as usize];
    if start == NONE {
        return Star::Broken;
    }
    let (mut count, mut open) = (0, false);
    for c in surface.around(start) {
        count += 1;
        open |= surface.turn(c) == NONE;
    }
    match (count == incident, open) {
        (false, _) => Star::Broken,
        (true, true) => Star::Open,
        (true, false) => Star::Closed,
    }
}

/// Neighbours of the vertex of corner `start`, counter-clockwise; those of at most `limit` triangles.
pub(super) fn ring(surface: &Surface, start: u32, limit: usize, mut near: impl FnMut(u32)) {
    for c in surface.around(start).take(limit) {
        near(surface.vertex(next(c)));
        if surface.turn(c) == NONE {
            near(surface.vertex(previous(c)));
        }
    }
}
