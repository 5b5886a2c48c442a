//! The triangles of a mesh some of whose collapses are undone.

use super::graph::{ConstraintGraph, Refusal};
use crate::forest::NO_REPRESENTATIVE;

const NONE: u32 = u32::MAX;

/// A mesh at any state that its [`ConstraintGraph`] allows; fully simplified at first. A split or a collapse costs as much as it changes: the
/// corners at its red vertex.
///
/// 56 bytes a triangle and 12 a vertex, with the graph beside. All of a triangle that a step looks at lies together: steps jump about, and each
/// jump is a cache line.
#[derive(Clone, Debug)]
pub struct LocalMesh {
    graph: ConstraintGraph,
    /// (blue, red) of each collapse.
    pairs: Vec<(u32, u32)>,
    /// Place of each vertex in the forest, representatives before what they stand for; and where those end that it stands for.
    place: Vec<(u32, u32)>,
    /// Three a triangle.
    corners: Vec<Corner>,
    /// First corner that each vertex holds.
    head: Vec<u32>,
    /// Triangles that are not degenerate, in no order; and where in that list each is, or [`NONE`].
    shown: Vec<u32>,
    shown_at: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    /// That stands here now.
    vertex: u32,
    /// Others of that vertex.
    next: u32,
    before: u32,
    /// Place of the finest vertex that stands here.
    place: u32,
}

impl LocalMesh {
    /// From the finest triangles and the collapses (blue, red) in the order that `graph` speaks of; it is [`ConstraintGraph::reduced`]. O(n). Errors: a vertex that does not exist or goes
    /// twice; a graph in which a vertex could be gone that another stands at.
    pub fn new(vertices: u32, finest: &[[u32; 3]], pairs: &[(u32, u32)], graph: ConstraintGraph) -> Result<Self, Refusal> {
        let parents = parents(vertices, pairs, &graph)?;
        if let Some(&vertex) = finest.iter().flatten().find(|&&v| v >= vertices) {
            return Err(Refusal::BadVertex { collapse: graph.len(), vertex });
        }
        let place = places(&parents);
        let corner = |v: &u32| Corner { vertex: NONE, next: NONE, before: NONE, place: place[*v as usize].0 };
        let mut mesh = Self {
            graph: graph.reduced()?,
            pairs: pairs.to_vec(),
            corners: finest.as_flattened().iter().map(corner).collect(),
            place,
            head: vec![NONE; vertices as usize],
            shown: Vec::new(),
            shown_at: vec![NONE; finest.len()],
        };
        let roots = roots(&parents);
        for (corner, &v) in finest.as_flattened().iter().enumerate() {
            mesh.link(corner as u32, roots[v as usize]);
        }
        (0..finest.len() as u32).for_each(|t| mesh.show_or_hide(t));
        Ok(mesh)
    }

    /// The order of the collapses, and their states.
    pub fn graph(&self) -> &ConstraintGraph {
        &self.graph
    }
    /// Triangles to draw, by their numbers, in no order.
    pub fn shown(&self) -> &[u32] {
        &self.shown
    }
    /// A triangle, corners at the vertices that stand for them now; if it is not [`Self::shown`] it is degenerate. `None` if there is none of that number.
    pub fn triangle(&self, t: u32) -> Option<[u32; 3]> {
        let corners = self.corners.get(3 * t as usize..)?.first_chunk::<3>()?;
        Some(corners.map(|c| c.vertex))
    }

    /// Undoes collapse `i`; gives the corners looked at.
    pub fn split(&mut self, i: u32) -> Result<u32, Refusal> {
        self.graph.split(i)?;
        let (blue, red) = self.pairs[i as usize];
        let (first, end) = self.place[blue as usize];
        let (mut corner, mut touched) = (self.head[red as usize], 0);
        while corner != NONE {
            let Corner { next, place, .. } = self.corners[corner as usize];
            if (first..end).contains(&place) {
                self.move_corner(corner, red, blue);
            }
            (corner, touched) = (next, touched + 1);
        }
        Ok(touched)
    }
    /// Does collapse `i`; gives the corners moved.
    pub fn collapse(&mut self, i: u32) -> Result<u32, Refusal> {
        self.graph.collapse(i)?;
        let (blue, red) = self.pairs[i as usize];
        let mut touched = 0;
        while self.head[blue as usize] != NONE {
            self.move_corner(self.head[blue as usize], blue, red);
            touched += 1;
        }
        Ok(touched)
    }

    fn move_corner(&mut self, corner: u32, from: u32, to: u32) {
        self.unlink(corner, from);
        self.link(corner, to);
        self.show_or_hide(corner / 3);
    }
    fn link(&mut self, corner: u32, v: u32) {
        let first = std::mem::replace(&mut self.head[v as usize], corner);
        let own = &mut self.corners[corner as usize];
        (own.vertex, own.next, own.before) = (v, first, NONE);
        if first != NONE {
            self.corners[first as usize].before = corner;
        }
    }
    fn unlink(&mut self, corner: u32, v: u32) {
        let Corner { next, before, .. } = self.corners[corner as usize];
        if before == NONE {
            self.head[v as usize] = next;
        } else {
            self.corners[before as usize].next = next;
        }
        if next != NONE {
            self.corners[next as usize].before = before;
        }
    }
    fn show_or_hide(&mut self, t: u32) {
        let is_whole = self.triangle(t).is_some_and(|[a, b, c]| a != b && b != c && c != a && a.max(b).max(c) != NONE);
        let at = self.shown_at[t as usize];
        if is_whole && at == NONE {
            self.shown_at[t as usize] = self.shown.len() as u32;
            self.shown.push(t);
        } else if !is_whole && at != NONE {
            self.shown_at[t as usize] = NONE;
            self.shown.swap_remove(at as usize);
            if let Some(&moved) = self.shown.get(at as usize) {
                self.shown_at[moved as usize] = at;
            }
        }
    }
}

/// What each vertex is collapsed onto in the end, step by step; checks that its target is there whenever it is undone.
fn parents(vertices: u32, pairs: &[(u32, u32)], graph: &ConstraintGraph) -> Result<Vec<u32>, Refusal> {
    if pairs.len() != graph.len() as usize {
        return Err(Refusal::NoSuchCollapse { collapse: graph.len().min(pairs.len() as u32) });
    }
    let (mut parents, mut goes) = (vec![NO_REPRESENTATIVE; vertices as usize], vec![NONE; vertices as usize]);
    for (i, &(blue, red)) in pairs.iter().enumerate() {
        let bad = [blue, red].into_iter().find(|&v| v >= vertices || goes[v as usize] != NONE);
        if let Some(vertex) = bad.or((blue == red).then_some(blue)) {
            return Err(Refusal::BadVertex { collapse: i as u32, vertex });
        }
        (parents[blue as usize], goes[blue as usize]) = (red, i as u32);
    }
    for (i, &(_, red)) in pairs.iter().enumerate() {
        let later = goes[red as usize];
        if later != NONE && graph.requires(later).binary_search(&(i as u32)).is_err() {
            return Err(Refusal::BadVertex { collapse: later, vertex: red });
        }
    }
    Ok(parents)
}

/// Places of a forest's vertices, each before what it stands for; and where those end.
fn places(parents: &[u32]) -> Vec<(u32, u32)> {
    let n = parents.len();
    let (mut child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
    for v in (0..n as u32).rev() {
        let p = parents[v as usize];
        if p != NO_REPRESENTATIVE {
            sibling[v as usize] = std::mem::replace(&mut child[p as usize], v);
        }
    }
    let mut places = vec![(0, 0); n];
    let mut next = 0;
    for root in (0..n as u32).filter(|&v| parents[v as usize] == NO_REPRESENTATIVE) {
        let mut v = root;
        loop {
            places[v as usize].0 = next;
            next += 1;
            if child[v as usize] != NONE {
                v = child[v as usize];
                continue;
            }
            // Up until there is another branch.
            loop {
                places[v as usize].1 = next;
                if v == root || sibling[v as usize] != NONE {
                    break;
                }
                v = parents[v as usize];
            }
            if v == root {
                break;
            }
            v = sibling[v as usize];
        }
    }
    places
}

/// The vertex that stands for each once all is collapsed.
fn roots(parents: &[u32]) -> Vec<u32> {
    let mut roots: Vec<u32> = (0..parents.len() as u32).collect();
    for v in 0..parents.len() {
        let (mut at, mut path) = (v as u32, Vec::new());
        while roots[at as usize] == at && parents[at as usize] != NO_REPRESENTATIVE {
            path.push(at);
            at = parents[at as usize];
        }
        let root = roots[at as usize];
        path.into_iter().for_each(|w| roots[w as usize] = root);
    }
    roots
}
