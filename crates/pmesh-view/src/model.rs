//! What a server has of a mesh: static, shared by all sessions.

use crate::base::{self, Base};
use crate::error::ProtocolError;
use crate::patch::Place;
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Bounds, NONE, Node, NodeId, VertexHierarchy};
use rustc_hash::FxHashMap;
use std::sync::{Mutex, PoisonError};

/// A hierarchy on a grid, ready to be served.
#[derive(Debug)]
pub struct Model {
    hierarchy: VertexHierarchy,
    grid: Quantisation,
    base: Vec<u8>,
    extent: [[f32; 3]; 2],
    fingerprint: u64,
    rings: Rings,
}

impl Model {
    /// `triangles` are the finest ones, corners at vertices; `grid` is that of the positions, or none: then they are exact floats. The roots are numbered as the message with the base mesh has them.
    /// O(n · depth). Errors: positions that are not on the grid, triangles of another hierarchy.
    pub fn new(mut hierarchy: VertexHierarchy, triangles: &[[u32; 3]], grid: Quantisation) -> Result<Self, ProtocolError> {
        let nodes = 0..hierarchy.nodes().len() as u32;
        let off = |i: u32| {
            let p = hierarchy.position(i);
            grid.position_of_row(grid.position_row(p)).map(f32::to_bits) != p.map(f32::to_bits)
        };
        if nodes.clone().any(off) {
            return Err(ProtocolError::Unexpected("positions of the hierarchy are not on its grid"));
        }
        // What the messages can say, and clients believe.
        let sayable = |n: &Node| {
            let b = n.bounds;
            let none = b.angle == Bounds::NO_CONE && b.axis == [0; 2] && b.directional == 0 && b.uniform > 0;
            let cone = b.angle < Bounds::NO_CONE && b.uniform >= Bounds::least_uniform(b.directional);
            let inner = (none || cone) && b.radius % 2 == 1 && n.cuts[0] != n.cuts[1];
            if n.child == NONE { b == Bounds::default() } else { inner }
        };
        if !hierarchy.nodes().iter().all(sayable) {
            return Err(ProtocolError::Unexpected("a hierarchy with bounds or cuts that cannot be"));
        }
        // FNV-1a over all that a client will ever be told.
        let mut fingerprint = 0xcbf2_9ce4_8422_2325u64;
        let mut mix = |x: u64| fingerprint = (fingerprint ^ x).wrapping_mul(0x0100_0000_01b3);
        for i in nodes {
            let (node, p) = (&hierarchy.nodes()[i as usize], hierarchy.position(i));
            p.iter().for_each(|x| mix(x.to_bits().into()));
            let b = node.bounds;
            mix(u64::from_le_bytes([b.radius, b.uniform, b.directional, b.axis[0] as u8, b.axis[1] as u8, b.angle, 0, 0]));
            [node.child, node.cuts[0], node.cuts[1]].into_iter().for_each(|x| mix(x.into()));
        }
        hierarchy.base_triangles().iter().flatten().for_each(|&v| mix(v.into()));
        let roots = 0..hierarchy.root_count();
        let bound = |k: usize, f: fn(f32, f32) -> f32| {
            (0..hierarchy.nodes().len() as u32).map(|i| hierarchy.position(i)[k]).reduce(f).unwrap_or(0.0)
        };
        let extent = [f32::min as fn(f32, f32) -> f32, f32::max].map(|f| [0, 1, 2].map(|k| bound(k, f)));
        let base = Base {
            fingerprint,
            unit: hierarchy.unit(),
            grid,
            positions: roots.clone().map(|i| hierarchy.position(i)).collect(),
            bounds: roots.map(|i| hierarchy.nodes()[i as usize].bounds).collect(),
            triangles: hierarchy.base_triangles().to_vec(),
            total: hierarchy.nodes().len() as u64,
            extent,
        };
        let (base, order) = base::write(&base)?;
        hierarchy.sort_roots(&order.roots, order.triangles)?;
        hierarchy.set_triangles(triangles)?;
        Ok(Self { base, hierarchy, grid, extent, fingerprint, rings: Rings::default() })
    }
    /// The hierarchy.
    pub fn hierarchy(&self) -> &VertexHierarchy {
        &self.hierarchy
    }
    /// Its grid.
    pub fn grid(&self) -> &Quantisation {
        &self.grid
    }
    /// Names this model, and this state of it.
    pub fn fingerprint(&self) -> u64 {
        self.fingerprint
    }
    /// Smallest and largest corner of the box about all of it.
    pub fn extent(&self) -> [[f32; 3]; 2] {
        self.extent
    }
    /// Nodes about node `i` of a front, as [`VertexHierarchy::neighbours`] has them, or as another session has found them that had the same ones.
    pub(crate) fn neighbours(
        &self,
        i: u32,
        is_active: impl Fn(u32) -> bool,
        active: impl Fn(u32) -> Option<u32>,
        out: &mut Vec<u32>,
    ) -> bool {
        // All that is about a node is below those that were found once: if these are in the front, they are what is about it.
        if let Some(closed) = self.rings.get(i, is_active, out) {
            return closed;
        }
        let Some(closed) = self.hierarchy.neighbours(i, active, out) else {
            out.clear();
            return false;
        };
        self.rings.put(i, closed, out);
        closed
    }
    /// The message with the base mesh.
    pub fn base(&self) -> &[u8] {
        &self.base
    }
    /// Where a node is, on the grid.
    pub(crate) fn row(&self, i: u32) -> [i32; 3] {
        self.grid.position_row(self.hierarchy.position(i))
    }
    /// What is to be known of a node.
    pub(crate) fn place(&self, i: u32) -> Place {
        let bounds = self.hierarchy.node(i).map_or(Bounds::default(), |n| n.bounds);
        Place { id: self.hierarchy.id(i).unwrap_or(NodeId::root(0)), row: self.row(i), bounds }
    }
    /// Names of a node's cuts.
    pub(crate) fn cuts(&self, i: u32) -> [Option<NodeId>; 2] {
        self.hierarchy.node(i).map_or([None; 2], |n| n.cuts.map(|c| self.hierarchy.id(c)))
    }
}

/// Rings by node, and whether they close.
type Shard = FxHashMap<u32, (bool, Box<[u32]>)>;

/// Rings that sessions have found: many look at the same.
#[derive(Debug)]
struct Rings {
    shards: Vec<Mutex<Shard>>,
}

/// Nodes whose rings are kept at a time, some 80 bytes each.
const RINGS_LIMIT: usize = 1 << 17;
/// Parts with a lock each.
const SHARDS: usize = 64;

impl Default for Rings {
    fn default() -> Self {
        Self { shards: (0..SHARDS).map(|_| Mutex::default()).collect() }
    }
}

impl Rings {
    /// The ring of a node, if there is one of nodes that all are in the front; whether it closes.
    fn get(&self, i: u32, is_active: impl Fn(u32) -> bool, out: &mut Vec<u32>) -> Option<bool> {
        let shard = self.shards[i as usize % SHARDS].lock().unwrap_or_else(PoisonError::into_inner);
        let (closed, ring) = shard.get(&i)?;
        if !ring.iter().all(|&w| is_active(w)) {
            return None;
        }
        out.clear();
        out.extend_from_slice(ring);
        Some(*closed)
    }
    fn put(&self, i: u32, closed: bool, ring: &[u32]) {
        let mut shard = self.shards[i as usize % SHARDS].lock().unwrap_or_else(PoisonError::into_inner);
        if shard.len() >= RINGS_LIMIT / SHARDS {
            shard.clear();
        }
        shard.insert(i, (closed, ring.into()));
    }
}
