//! The finest mesh below a hierarchy: by it the neighbours of a node are found in any front, though no mesh of that front is kept.

use super::{HierarchyError, NONE, VertexHierarchy};
use crate::surface::{Surface, next, previous};
use crate::turned;
use std::collections::HashMap;

/// Triangles of the finest mesh; leaves by their rank, in the order of a walk: what lies below a node is a range. 24 bytes a triangle, 17 a node.
#[derive(Clone, Debug, Default)]
pub(super) struct Finest {
    surface: Surface,
    leaf_of_rank: Vec<u32>,
    /// The node above each, or [`NONE`]: ways up look at nothing else.
    parents: Vec<u32>,
    depths: Vec<u8>,
    /// The ranks below each node: the first, and the one behind the last.
    below: Vec<[u32; 2]>,
    /// A triangle at each root, and one that came with each split.
    begins: Vec<u32>,
}

impl Finest {
    /// The node above one, if [`VertexHierarchy::set_triangles`] was called; [`NONE`] above a root.
    #[inline]
    pub(super) fn parent(&self, i: u32) -> Option<u32> {
        self.parents.get(i as usize).copied()
    }
    pub(super) fn depth(&self, i: u32) -> u32 {
        self.depths.get(i as usize).map_or(0, |&d| d.into())
    }
}

impl VertexHierarchy {
    /// Takes up the finest triangles, corners at vertices, for [`Self::neighbours`]. O(n · depth). Errors: triangles that are not those of the collapses.
    pub fn set_triangles(&mut self, triangles: &[[u32; 3]]) -> Result<(), HierarchyError> {
        let (nodes, roots) = (self.nodes(), self.root_count() as usize);
        let mut below = vec![[NONE; 2]; nodes.len()];
        let mut leaf_of_rank = Vec::with_capacity(nodes.len() / 2 + roots);
        let mut rank_of_vertex = vec![NONE; nodes.len()];
        let mut stack = Vec::new();
        for root in 0..roots as u32 {
            stack.push((root, false));
            while let Some((i, is_done)) = stack.pop() {
                let (count, child) = (leaf_of_rank.len() as u32, nodes[i as usize].child);
                if is_done {
                    below[i as usize][1] = count;
                    continue;
                }
                below[i as usize] = [count, count + 1];
                if child == NONE {
                    rank_of_vertex[nodes[i as usize].vertex as usize] = count;
                    leaf_of_rank.push(i);
                } else {
                    stack.extend([(i, true), (child + 1, false), (child, false)]);
                }
            }
        }
        // What is across an edge of the base mesh, whose corners are where these are.
        let base = Surface::new(self.base_triangles().to_vec(), roots as u32);
        let base_places: HashMap<[u32; 3], u32> = base.places();
        let mut of_base = vec![NONE; base.triangles.len()];
        let mut begins = vec![NONE; roots + (nodes.len() - roots) / 2];
        let mut kept = Vec::with_capacity(triangles.len());
        let mut sorted = Vec::with_capacity(triangles.len());
        for (number, triangle) in triangles.iter().enumerate().filter(|(_, [a, b, c])| a != b && b != c && c != a) {
            let bad = HierarchyError::BadTriangle { triangle: number as u32 };
            let ranks = triangle.map(|v| rank_of_vertex.get(v as usize).copied().unwrap_or(NONE));
            if ranks.contains(&NONE) {
                return Err(bad);
            }
            sorted.push((ranks, number as u32));
        }
        // What lies together is looked at together.
        sorted.sort_unstable_by_key(|(ranks, number)| (ranks.iter().min().copied(), *number));
        for (ranks, number) in sorted {
            let bad = HierarchyError::BadTriangle { triangle: number };
            let t = kept.len() as u32;
            kept.push(ranks);
            let leaves = ranks.map(|r| leaf_of_rank[r as usize]);
            // The lowest node above two of them: its split brings the triangle.
            let meet = |a: u32, b: u32| {
                let mut at = leaves[a as usize];
                while at != NONE && !is_in(ranks[b as usize], below[at as usize]) {
                    at = nodes[at as usize].parent;
                }
                Some((at, 3 - a - b)).filter(|m| m.0 != NONE)
            };
            let pairs = [meet(0, 1), meet(1, 2), meet(2, 0)].into_iter().flatten();
            let lowest = pairs.min_by_key(|m| below[m.0 as usize][1] - below[m.0 as usize][0]);
            let Some((s, cut)) = lowest else {
                let root = |r: u32| {
                    let mut at = leaf_of_rank[r as usize];
                    while nodes[at as usize].parent != NONE {
                        at = nodes[at as usize].parent;
                    }
                    at
                };
                let place = base_places.get(&turned(ranks.map(root))).ok_or(bad)?;
                of_base[*place as usize] = t;
                continue;
            };
            let node = &nodes[s as usize];
            // (blue, red, cut), then (blue, cut, red).
            let second = is_in(ranks[(cut as usize + 1) % 3], below[node.child as usize]);
            if node.cuts[usize::from(second)] != leaves[cut as usize] {
                return Err(bad);
            }
            let split = roots + (node.child as usize - roots) / 2;
            if begins[split] == NONE || second {
                begins[split] = t;
            }
        }
        let mut surface = Surface::new(kept, leaf_of_rank.len() as u32);
        for (v, begin) in begins[..roots].iter_mut().enumerate() {
            *begin = match base.corner_of[v] {
                NONE => NONE,
                c => of_base[c as usize / 3],
            };
        }
        // Clients find what is across the edges of the base by its corners alone. Where more than two triangles meet nothing is, in the finest mesh too; and a hole that has become an edge
        // is sewn up.
        let edge = |surface: &Surface, c: u32| {
            let (own, finest) = (below[base.vertex(c) as usize], of_base[c as usize / 3]);
            // Of triangles that are there twice one is enough.
            let corners = if finest == NONE { 0..0 } else { 3 * finest..3 * finest + 3 };
            corners.into_iter().find(|&d| is_in(surface.vertex(d), own))
        };
        for c in 0..3 * base.triangles.len() as u32 {
            let Some(e) = edge(&surface, c) else { continue };
            let other = base.across[c as usize];
            let ends = [c, next(c)].map(|c| below[base.vertex(c) as usize]);
            if other == NONE {
                let (across, last) = beyond(&surface, e, ends);
                if across != NONE {
                    (surface.across[last as usize], surface.across[across as usize]) = (NONE, NONE);
                }
            } else if let Some(f) = edge(&surface, other).filter(|_| c < other) {
                let back = [ends[1], ends[0]];
                if let ((NONE, e), (NONE, f)) = (beyond(&surface, e, ends), beyond(&surface, f, back)) {
                    (surface.across[e as usize], surface.across[f as usize]) = (f, e);
                }
            }
        }
        let parents: Vec<u32> = nodes.iter().map(|n| n.parent).collect();
        let mut depths = vec![0u8; nodes.len()];
        for i in roots..nodes.len() {
            depths[i] = depths[parents[i] as usize].saturating_add(1);
        }
        self.finest = Finest { surface, leaf_of_rank, parents, depths, below, begins };
        Ok(())
    }
    /// True if a leaf lies below a node, or is it. O(1), after [`Self::set_triangles`].
    pub fn is_below(&self, leaf: u32, node: u32) -> bool {
        let ranges = [leaf, node].map(|i| self.finest.below.get(i as usize));
        matches!(ranges, [Some(leaf), Some(node)] if is_in(leaf[0], *node))
    }
    /// Nodes about node `i` of a front, counter-clockwise, and whether they close; `active` gives the front's node above a leaf. Begins where [`super::Front::neighbours`] does. `None` if `i` is not in the front
    /// or has no triangles. O(triangles of the finest mesh along its rim, valence · depth).
    pub fn neighbours(&self, i: u32, active: impl Fn(u32) -> Option<u32>, out: &mut Vec<u32>) -> Option<bool> {
        out.clear();
        let Finest { surface: s, leaf_of_rank, below, begins, .. } = &self.finest;
        let roots = self.root_count();
        let &own = below.get(i as usize)?;
        let begin = match self.nodes()[i as usize].parent {
            NONE => i,
            parent => roots + (self.nodes()[parent as usize].child - roots) / 2,
        };
        let t = begins.get(begin as usize).copied().filter(|&t| t != NONE)?;
        let start = (3 * t..3 * t + 3).find(|&c| is_in(s.vertex(c), own))?;
        let above = |c: u32| active(leaf_of_rank[s.vertex(c) as usize]);
        let (mut c, mut closed) = (start, false);
        let first = above(next(start))?;
        out.push(first);
        loop {
            // The triangle at corner c lies between the last of the list and this one.
            let w = above(previous(c))?;
            // Corner e is in the node, the next one in w.
            let e = beyond(s, previous(c), [below[w as usize], own]).0;
            if e == start {
                closed = true;
                break;
            }
            out.push(w);
            if e == NONE {
                break;
            }
            c = e;
        }
        if closed {
            return Some(true);
        }
        // Open: what is clockwise of the start goes in front.
        let mut before = Vec::new();
        let (mut c, mut w) = (start, first);
        loop {
            // Corner e is in w, the next one in the node.
            let e = beyond(s, c, [own, below[w as usize]]).0;
            if e == NONE {
                break;
            }
            c = next(e);
            w = above(next(c))?;
            before.push(w);
        }
        out.splice(0..0, before.into_iter().rev());
        Some(false)
    }
}

fn is_in(rank: u32, [from, to]: [u32; 2]) -> bool {
    from <= rank && rank < to
}
/// What is across an edge that leads from one node to another, past the triangles of these two alone, which are nothing where both are in a front; and the last edge before it.
fn beyond(s: &Surface, edge: u32, [from, to]: [[u32; 2]; 2]) -> (u32, u32) {
    let mut e = edge;
    loop {
        // From `to` to `from`.
        let other = s.across[e as usize];
        if other == NONE {
            return (NONE, e);
        }
        let third = s.vertex(previous(other));
        if is_in(third, from) {
            e = previous(other);
        } else if is_in(third, to) {
            e = next(other);
        } else {
            return (other, e);
        }
    }
}
