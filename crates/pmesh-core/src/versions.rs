//! Vertices that move between levels: each place a vertex stands at is a *version*, its representative the one before.
//!
//! Outside, a vertex keeps the index it arrived with (its *logical* index). Inside, versions are entries of the same
//! arrays (*physical* indices), so prefix and forest are all that selecting a level needs. Allocated at the first move.

use std::collections::BTreeMap;

/// The two numberings. Absent, they are the same. The tables end with the newest version: after it an entry is a vertex that has not moved.
#[derive(Clone, Debug)]
pub(crate) struct Versions {
    /// Newest version of each vertex as of the last complete level.
    current: Vec<u32>,
    /// The vertex that each entry is a version of.
    logical: Vec<u32>,
    /// Vertices, those past the tables counted.
    count: u32,
    /// Vertex and new version, of the level that is still arriving.
    open: BTreeMap<u32, u32>,
}

impl Versions {
    pub(crate) fn identity(count: u32) -> Self {
        Self { current: (0..count).collect(), logical: (0..count).collect(), count, open: BTreeMap::new() }
    }
    pub(crate) fn vertex_count(&self) -> u32 {
        self.count
    }
    /// Versions that are not a vertex's first.
    fn later_versions(&self) -> u32 {
        (self.logical.len() - self.current.len()) as u32
    }
    /// For each vertex, its newest version among the first `entries` entries; vertices that begin later are left out.
    pub(crate) fn newest_below(&self, entries: u32) -> Vec<u32> {
        let mut newest = Vec::new();
        for entry in 0..entries {
            match newest.get_mut(self.logical(entry) as usize) {
                Some(slot) => *slot = entry,
                None => newest.push(entry),
            }
        }
        newest
    }
    pub(crate) fn current(&self, vertex: u32) -> u32 {
        self.current.get(vertex as usize).copied().unwrap_or_else(|| vertex + self.later_versions())
    }
    pub(crate) fn logical(&self, entry: u32) -> u32 {
        self.logical.get(entry as usize).copied().unwrap_or_else(|| entry - self.later_versions())
    }
    pub(crate) fn push_vertex(&mut self) {
        self.count += 1;
    }
    pub(crate) fn push_version(&mut self, vertex: u32) {
        let (known, later) = (self.current.len() as u32, self.later_versions());
        self.current.extend((known..self.count).map(|v| v + later));
        self.logical.extend(known..self.count);
        self.open.insert(vertex, self.logical.len() as u32);
        self.logical.push(vertex);
    }
    pub(crate) fn moves_in_open_level(&self, vertex: u32) -> bool {
        self.open.contains_key(&vertex)
    }
    /// Ends the level: (old entry, new entry) of every vertex that moved, ascending by old entry.
    pub(crate) fn complete(&mut self) -> Vec<(u32, u32)> {
        let moved = std::mem::take(&mut self.open);
        let mut pairs: Vec<_> =
            moved.into_iter().map(|(v, entry)| (std::mem::replace(&mut self.current[v as usize], entry), entry)).collect();
        pairs.sort_unstable();
        pairs
    }
    pub(crate) fn memory_bytes(&self) -> usize {
        4 * (self.current.capacity() + self.logical.capacity())
    }
}
