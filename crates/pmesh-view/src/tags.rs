//! Which nodes a client has as leaves: the server's whole memory of it (E.14).

use roaring::RoaringBitmap;

/// A set of node numbers. The paper keeps a window of bits about all that are set; here each 65,536 numbers are bits where many are set, else a list,
/// so that an uneven front costs no more than its nodes do: 2 bytes each while a list grows by no more than it needs, and at most 8 kB for each 65,536 numbers.
///
/// Numbers only go out and higher ones come in: the least never sinks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActiveTags {
    set: RoaringBitmap,
}

impl ActiveTags {
    /// The roots.
    pub fn new(roots: u32) -> Self {
        Self { set: (0..roots).collect() }
    }
    /// Nothing.
    pub fn empty() -> Self {
        Self::default()
    }
    /// Adds a leaf that a client says it has.
    pub fn insert(&mut self, i: u32) {
        self.set.insert(i);
    }
    /// True if node `i` is in the front. O(log n).
    pub fn contains(&self, i: u32) -> bool {
        self.set.contains(i)
    }
    /// Puts two children in their parent's place.
    pub fn split(&mut self, parent: u32, child: u32) {
        self.set.remove(parent);
        // Not as a range: lists of ranges are larger here.
        self.set.insert(child);
        self.set.insert(child + 1);
    }
    /// Appends up to `limit` numbers from `from` on to `out`, ascending.
    pub fn list(&self, from: u32, limit: usize, out: &mut Vec<u32>) {
        out.extend(self.set.range(from..).take(limit));
    }
    /// The least number and the greatest: the paper's window.
    pub fn window(&self) -> Option<(u32, u32)> {
        self.set.min().zip(self.set.max())
    }
    /// Nodes in the front.
    pub fn len(&self) -> u64 {
        self.set.len()
    }
    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.set.is_empty()
    }
    /// Bytes that it takes.
    pub fn memory_bytes(&self) -> usize {
        let s = self.set.statistics();
        let lists = s.n_bytes_array_containers + s.n_bytes_run_containers;
        // The library says 65,536 of each that is bits; it means those.
        size_of::<Self>() + lists as usize + s.n_bitset_containers as usize * 8192 + s.n_containers as usize * 40
    }
}
