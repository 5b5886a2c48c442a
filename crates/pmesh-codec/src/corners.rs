//! Which corners hold a vertex, while a stream of splits is read or written: linked lists, 4 bytes a corner, 12 a vertex.

const NONE: u32 = u32::MAX;

/// For each vertex, the corners that hold it, in two lists: those of earlier levels, which records speak of, and those of
/// the level that is arriving, which join the others when the vertex is next looked at. So no level ends with a burst of
/// work, and every corner is moved over once.
#[derive(Default)]
pub(crate) struct Corners {
    head: Vec<u32>,
    fresh: Vec<u32>,
    /// Level that the fresh corners of a vertex are of.
    stamp: Vec<u32>,
    next: Vec<u32>,
    level: u32,
}

impl Corners {
    pub(crate) fn begin_level(&mut self) {
        self.level += 1;
    }
    pub(crate) fn add_vertex(&mut self) {
        self.head.push(NONE);
        self.fresh.push(NONE);
        self.stamp.push(self.level);
    }
    pub(crate) fn add_triangle(&mut self, triangle: [u32; 3]) {
        for v in triangle {
            self.settle(v);
            self.stamp[v as usize] = self.level;
            let corner = self.next.len() as u32;
            self.next.push(std::mem::replace(&mut self.fresh[v as usize], corner));
        }
    }
    /// Joins the fresh corners of an earlier level to the others.
    fn settle(&mut self, v: u32) {
        let v = v as usize;
        if self.stamp[v] == self.level || self.fresh[v] == NONE {
            return;
        }
        let first = std::mem::replace(&mut self.fresh[v], NONE);
        let mut last = first;
        while self.next[last as usize] != NONE {
            last = self.next[last as usize];
        }
        self.next[last as usize] = std::mem::replace(&mut self.head[v], first);
    }
    /// Corners of earlier levels that hold `v`, ascending.
    pub(crate) fn of(&mut self, v: u32, out: &mut Vec<u32>) {
        self.settle(v);
        out.clear();
        let mut corner = self.head[v as usize];
        while corner != NONE {
            out.push(corner);
            corner = self.next[corner as usize];
        }
        out.sort_unstable();
    }
    /// Hands the corners of `from` out: to `to` where the bit is set.
    pub(crate) fn split(&mut self, from: u32, to: u32, candidates: &[u32], moves: impl Fn(usize) -> bool) {
        let (mut stay, mut go) = (NONE, NONE);
        for (i, &corner) in candidates.iter().enumerate() {
            let list = if moves(i) { &mut go } else { &mut stay };
            self.next[corner as usize] = std::mem::replace(list, corner);
        }
        self.head[from as usize] = stay;
        self.head[to as usize] = go;
    }
}
