//! The mesh of all that is known: where cuts are told by it, and get longer with it.
//!
//! Of a cut only that node need be told that is known so far. When this one splits later on, the mesh of all that is known says on which side of it the cut lies: where
//! the triangle lies that it is a corner of. So no bit is ever sent for that.

use super::{Front, FrontMesh, HierarchyError, NONE, NodeId, Split};

/// A front at the leaves of what is known.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownMesh {
    mesh: FrontMesh,
    /// The node without children here that stands at each vertex.
    leaf_of: Vec<u32>,
}

impl KnownMesh {
    pub(super) fn memory_bytes(&self) -> usize {
        self.mesh.memory_bytes() + 4 * self.leaf_of.len()
    }
}

impl Front {
    /// From now on cuts that are learnt are nodes without children here, and go on with these as they get some. O(known). The front must be at these nodes, as one is
    /// that knows nothing but the base mesh.
    pub fn follow_cuts(&mut self) {
        let mut mesh = self.mesh.undrawn();
        let mut leaf_of = vec![NONE; self.positions.len()];
        for i in (0..self.known.len() as u32).filter(|&i| self.known[i as usize].child == NONE) {
            let vertex = self.known[i as usize].vertex;
            leaf_of[vertex as usize] = i;
            // Fans begin where they would if all had come just now.
            let parent = self.known[i as usize].parent;
            let corners = mesh.fan(vertex).0;
            let begin = if parent == NONE {
                corners.iter().copied().filter(|c| c / 3 < self.base_triangles).min()
            } else {
                let first = self.base_triangles + 2 * self.number(self.known[parent as usize].child);
                let of = |t: u32| corners.iter().copied().find(|c| c / 3 == t);
                of(first + 1).or(of(first))
            };
            begin.into_iter().for_each(|c| mesh.begin_at(vertex, c));
        }
        let cuts = self.cuts.iter().map(|cuts| {
            cuts.map(|cut| {
                // As far as it is known still.
                let mut at = cut;
                while at.node > 1 && self.find(at).is_none() {
                    at.node >>= 1;
                }
                at
            })
        });
        self.cuts = cuts.collect();
        self.whole = Some(KnownMesh { mesh, leaf_of });
    }
    /// True from [`Self::follow_cuts`] on.
    pub fn follows_cuts(&self) -> bool {
        self.whole.is_some()
    }
    /// Splits node `i` in the mesh of all that is known; cuts that stood there stand at one of its children.
    pub(super) fn learn_whole(&mut self, i: u32, split: &Split) -> Result<(), HierarchyError> {
        let Some(mut whole) = self.whole.take() else { return Ok(()) };
        let result = self.split_whole(&mut whole, i, split);
        self.whole = Some(whole);
        result
    }
    fn split_whole(&mut self, whole: &mut KnownMesh, i: u32, split: &Split) -> Result<(), HierarchyError> {
        let child = self.known.len() as u32;
        let number = self.number(child);
        let (red, blue) = (self.known[i as usize].vertex, self.positions.len() as u32);
        let mut ends = [NONE; 2];
        for (end, cut) in ends.iter_mut().zip(split.cuts) {
            let Some(cut) = cut else { continue };
            let leaf = self.find(cut).map(|c| self.known[c as usize]).filter(|k| k.child == NONE);
            *end = leaf.ok_or(HierarchyError::BadCut { id: split.id, cut })?.vertex;
        }
        let first = self.base_triangles + 2 * number;
        if !whole.mesh.split(red, blue, ends, [first, first + 1]) {
            return Err(HierarchyError::NotAdjacent { id: split.id });
        }
        whole.leaf_of[red as usize] = child;
        whole.leaf_of.push(child + 1);
        for (second, vertex) in [(false, red), (true, blue)] {
            let Some(id) = split.id.child(second) else { continue };
            for &c in whole.mesh.fan(vertex).0 {
                // Of (blue, red, cut) the last, of (blue, cut, red) the second.
                let Some(place) = (c / 3).checked_sub(self.base_triangles) else { continue };
                let (n, k) = (place / 2, place % 2);
                if n != number && c % 3 == 2 - k {
                    self.cuts[n as usize][k as usize] = id;
                }
            }
        }
        Ok(())
    }

    /// Nodes about node `i` among those without children here, counter-clockwise, and whether they close; it begins at the triangle that came last with `i`, or at the
    /// first one of the base. Nothing if `i` has children, or if cuts are not followed. O(valence).
    pub fn neighbours(&mut self, i: u32, out: &mut Vec<u32>) -> bool {
        out.clear();
        let (Some(whole), Some(own)) = (&mut self.whole, self.known.get(i as usize).filter(|k| k.child == NONE)) else {
            return false;
        };
        let (_, vertices, closed) = whole.mesh.fan(own.vertex);
        out.extend(vertices.iter().map(|&v| whole.leaf_of[v as usize]));
        closed
    }
    /// The triangles between the nodes that [`Self::neighbours`] gives, in their order, by number: those of the base mesh come first, then two for each split. O(valence).
    pub fn triangles_about(&mut self, i: u32, out: &mut Vec<u32>) {
        out.clear();
        if let (Some(whole), Some(own)) = (&mut self.whole, self.known.get(i as usize).filter(|k| k.child == NONE)) {
            out.extend(whole.mesh.fan(own.vertex).0.iter().map(|c| c / 3));
        }
    }
    /// The node without children here that corner `k` of a triangle is at, numbered as [`Self::triangles_about`] has them: (second child, first child, cut) and
    /// (second child, cut, first child) when they came with a split. `None` if there is none, or if cuts are not followed. O(1).
    pub fn node_at(&self, triangle: u32, k: usize) -> Option<u32> {
        let whole = self.whole.as_ref()?;
        let vertex = *whole.mesh.triangle(triangle)?.get(k)?;
        whole.leaf_of.get(vertex as usize).copied().filter(|&i| i != NONE)
    }
    /// More of the way to cut `k` of a split, if its children are known. What is no longer than what is known changes nothing. O(depth).
    pub fn lengthen_cut(&mut self, id: NodeId, k: usize, cut: NodeId) {
        let child = self.find(id).map_or(NONE, |i| self.known[i as usize].child);
        if child == NONE || k > 1 {
            return;
        }
        let number = self.number(child) as usize;
        let own = &mut self.cuts[number][k];
        if own.node != 0 && own.is_above(cut) {
            *own = cut;
        }
    }
    /// Steps from the root to a node.
    pub fn depth(&self, i: u32) -> u32 {
        self.known.get(i as usize).map_or(0, |k| k.depth.into())
    }
}
