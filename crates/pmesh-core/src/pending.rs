//! Vertices that triangles already use but that have not arrived (the text format does this, A.21).
//!
//! Sized by what was read: a map entry for each such vertex, the corners that wait for it, and the vertices that wait
//! behind it in the chain of representatives.

use crate::MeshError;
use std::collections::HashMap;

/// Longest chain of vertices that have not arrived. Each link moves the corners behind it once, so this bounds the work.
const CHAIN_LIMIT: u32 = 128;

#[derive(Clone, Debug)]
struct Waiting {
    representative: u32,
    depth: u32,
    /// Corners (3 × triangle + corner) whose finest vertex this is.
    corners: Vec<u32>,
    /// Vertices that have not arrived and whose representative this is, those that corners wait for.
    behind: Vec<u32>,
    /// True once this is in the list of its own representative.
    linked: bool,
}

/// The vertices that have a representative but have not arrived.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pending(HashMap<u32, Waiting>);

impl Pending {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Notes that `representative` stands for `vertex`.
    pub(crate) fn insert(&mut self, vertex: u32, representative: u32) -> Result<(), MeshError> {
        if representative >= vertex {
            return Err(MeshError::BadRepresentative { vertex, representative });
        }
        if self.0.contains_key(&vertex) {
            return Err(MeshError::SecondRepresentative { vertex, representative });
        }
        // A parent that is named later counts as arrived here; `resolve` measures what a corner really walks.
        let depth = self.0.get(&representative).map_or(0, |w| w.depth) + 1;
        if depth > CHAIN_LIMIT {
            return Err(MeshError::ChainTooLong { vertex, limit: CHAIN_LIMIT });
        }
        self.0.insert(vertex, Waiting { representative, depth, corners: Vec::new(), behind: Vec::new(), linked: false });
        Ok(())
    }

    pub(crate) fn forget(&mut self, vertex: u32) {
        self.0.remove(&vertex);
    }

    pub(crate) fn representative(&self, vertex: u32) -> Option<u32> {
        self.0.get(&vertex).map(|w| w.representative)
    }

    /// First ancestor of `vertex` below `count`, all vertices from `count` on being pending.
    pub(crate) fn resolve(&self, vertex: u32, count: u32) -> Result<Option<u32>, MeshError> {
        let mut v = vertex;
        for _ in 0..=CHAIN_LIMIT {
            if v < count {
                return Ok(Some(v));
            }
            match self.representative(v) {
                Some(parent) => v = parent,
                None => return Ok(None),
            }
        }
        Err(MeshError::ChainTooLong { vertex, limit: CHAIN_LIMIT })
    }

    /// Notes that `corner` waits for `vertex`, and links the chain behind it.
    pub(crate) fn wait(&mut self, vertex: u32, corner: u32) {
        let mut v = vertex;
        if let Some(w) = self.0.get_mut(&v) {
            w.corners.push(corner);
        }
        while let Some(own) = self.0.get_mut(&v).filter(|w| !w.linked) {
            let parent = own.representative;
            let Some(above) = self.0.get_mut(&parent) else { break };
            above.behind.push(v);
            if let Some(own) = self.0.get_mut(&v) {
                own.linked = true;
            }
            v = parent;
        }
    }

    /// Takes `vertex`, which arrives, out, and gives every corner that now moves to it.
    pub(crate) fn arrive(&mut self, vertex: u32) -> Vec<u32> {
        let Some(waiting) = self.0.remove(&vertex) else { return Vec::new() };
        let mut corners = waiting.corners;
        let mut stack = waiting.behind;
        while let Some(v) = stack.pop() {
            if let Some(w) = self.0.get(&v) {
                corners.extend_from_slice(&w.corners);
                stack.extend_from_slice(&w.behind);
            }
        }
        corners
    }
}
