//! A single-rate coder for the base mesh: triangles grow over open edges, a vertex is predicted by a parallelogram.
//!
//! In the manner of Touma & Gotsman's: the oldest open edge is looked at first, so that the front closes behind itself, and
//! what lies across it is coded by how many triangles its two vertices have already. Any mesh can be coded: a vertex that is
//! known but not beside the edge is named by its number, and edges of many triangles pair up as they come.

use super::rows::{RowModel, Rows};
use crate::range::{Chance, Coder, NumberModel};
use pmesh_core::surface::NONE;
use std::collections::{HashMap, VecDeque};

/// Length of the edge, in grid steps, that is expected where there is none yet.
const FAR: i64 = 1 << 11;
/// Classes of triangle counts at a vertex.
const FULLNESS: usize = 7;

/// What lies across an open edge.
#[derive(Clone, Copy, PartialEq)]
enum Across {
    Nothing = 0,
    NewVertex,
    /// The vertex before the edge along the border of what is known.
    Left,
    /// The one after it.
    Right,
    Known,
}

const ACROSS: [Across; 8] = {
    use Across::{Known, Left, NewVertex, Nothing, Right};
    [Nothing, NewVertex, Left, Right, Known, Nothing, Nothing, Nothing]
};

/// What the encoder knows and the decoder is told.
pub(crate) struct BaseTruth<'a> {
    /// Rows of the vertices, in the encoder's numbering.
    pub(crate) rows: &'a Rows,
    pub(crate) triangles: &'a [[u32; 3]],
    /// Seams: the vertex whose position a vertex shares, or [`NONE`].
    pub(crate) position_of: &'a [u32],
    /// Triangles by directed edge, last ones first.
    edges: HashMap<(u32, u32), Vec<u32>>,
    taken: Vec<bool>,
    next_seed: usize,
    next_unused: usize,
    /// First coded vertex at each position, by the vertex that stands for the position.
    first_at: HashMap<u32, u32>,
    /// The coder's number of each vertex, or [`NONE`]; and the encoder's number of each coded one.
    pub(crate) coded: Vec<u32>,
    pub(crate) vertex_order: Vec<u32>,
    pub(crate) triangle_order: Vec<u32>,
}

impl<'a> BaseTruth<'a> {
    pub(crate) fn new(rows: &'a Rows, triangles: &'a [[u32; 3]], position_of: &'a [u32]) -> Self {
        let mut edges: HashMap<(u32, u32), Vec<u32>> = HashMap::with_capacity(triangles.len() * 3);
        for (i, t) in triangles.iter().enumerate().rev() {
            (0..3).for_each(|k| edges.entry((t[k], t[(k + 1) % 3])).or_default().push(i as u32));
        }
        let coded = vec![NONE; position_of.len()];
        let taken = vec![false; triangles.len()];
        Self {
            rows,
            triangles,
            position_of,
            edges,
            taken,
            next_seed: 0,
            next_unused: 0,
            first_at: HashMap::new(),
            coded,
            vertex_order: vec![],
            triangle_order: vec![],
        }
    }
    /// Takes a triangle that has the directed edge, in coded numbers; gives its third vertex, in the encoder's numbers.
    fn take(&mut self, a: u32, b: u32) -> Option<u32> {
        let (a, b) = (self.vertex_order[a as usize], self.vertex_order[b as usize]);
        let list = self.edges.get_mut(&(a, b))?;
        let t = loop {
            let t = list.pop()?;
            if !self.taken[t as usize] {
                break t;
            }
        };
        self.taken[t as usize] = true;
        self.triangle_order.push(t);
        let triangle = self.triangles[t as usize];
        let k = (0..3).find(|&k| triangle[k] == a && triangle[(k + 1) % 3] == b)?;
        Some(triangle[(k + 2) % 3])
    }
    /// Says that `v` has been coded, as number `coded`.
    pub(crate) fn know(&mut self, v: u32, coded: u32) {
        self.coded[v as usize] = coded;
        self.first_at.entry(self.position(v)).or_insert(coded);
    }
    fn position(&self, v: u32) -> u32 {
        match self.position_of[v as usize] {
            NONE => v,
            p => p,
        }
    }
    /// The coder's number of the first vertex at the position of `v`.
    fn first_there(&self, v: u32) -> Option<u32> {
        self.first_at.get(&self.position(v)).copied()
    }
    /// The next vertex that no triangle uses.
    fn unused(&mut self) -> Option<u32> {
        let v = (self.next_unused..self.coded.len()).find(|&v| self.coded[v] == NONE)?;
        self.next_unused = v + 1;
        Some(v as u32)
    }
    fn seed(&mut self) -> Option<[u32; 3]> {
        while self.next_seed < self.taken.len() {
            let t = self.next_seed;
            self.next_seed += 1;
            if !self.taken[t] {
                self.taken[t] = true;
                self.triangle_order.push(t as u32);
                return Some(self.triangles[t]);
            }
        }
        None
    }
}

/// The coder of either direction, in steps.
pub(crate) struct BaseCoder {
    vertex_total: u32,
    triangle_total: u32,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Open edges that wait to be looked at: a, b, and the vertex opposite in the triangle that has them.
    queue: VecDeque<(u32, u32, u32)>,
    /// Open directed edges: how many.
    open: HashMap<(u32, u32), u32>,
    /// For each vertex, where open edges that end and that begin there come from and go to; stale ones are dropped in passing.
    into: Vec<Vec<u32>>,
    out_of: Vec<Vec<u32>>,
    fullness: Vec<u8>,
    across: Vec<[Chance; 8]>,
    seed_is_known: Chance,
    number: NumberModel,
    seam: NumberModel,
    rows: RowModel,
}

impl BaseCoder {
    pub(crate) fn new(vertex_total: u32, triangle_total: u32, width: usize) -> Self {
        Self {
            vertex_total,
            triangle_total,
            triangles: Vec::new(),
            queue: VecDeque::new(),
            open: HashMap::new(),
            into: Vec::new(),
            out_of: Vec::new(),
            fullness: Vec::new(),
            across: vec![[Chance::default(); 8]; FULLNESS * FULLNESS],
            seed_is_known: Chance::default(),
            number: NumberModel::default(),
            seam: NumberModel::default(),
            rows: RowModel::new(width),
        }
    }

    /// Codes about `limit` more triangles or vertices; true once the mesh is whole.
    pub(crate) fn step(
        &mut self,
        coder: &mut impl Coder,
        rows: &mut Rows,
        mut truth: Option<&mut BaseTruth>,
        limit: usize,
    ) -> Result<bool, &'static str> {
        for _ in 0..limit {
            if (self.triangles.len() as u32) < self.triangle_total {
                match self.queue.pop_front() {
                    Some((a, b, opposite)) => self.edge(coder, rows, truth.as_deref_mut(), (a, b, opposite))?,
                    None => self.component(coder, rows, truth.as_deref_mut())?,
                }
            } else if rows.count() < self.vertex_total {
                // Vertices that no triangle uses.
                let next = truth.as_deref_mut().and_then(|t| t.unused());
                self.vertex(coder, rows, truth.as_deref_mut(), next, None)?;
            } else {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn component(
        &mut self,
        coder: &mut impl Coder,
        rows: &mut Rows,
        mut truth: Option<&mut BaseTruth>,
    ) -> Result<(), &'static str> {
        let seed = truth.as_deref_mut().and_then(|t| t.seed());
        let mut triangle = [0; 3];
        for k in 0..3 {
            let wanted = seed.map(|s| s[k]);
            let known = truth.as_deref().zip(wanted).map(|(t, v)| t.coded[v as usize]).filter(|&c| c != NONE);
            triangle[k] = if coder.bit(&mut self.seed_is_known, known.is_some()) {
                self.known(coder, rows, known)?
            } else {
                let beside = k.checked_sub(1).map(|j| (triangle[j], triangle[j], triangle[j]));
                self.vertex(coder, rows, truth.as_deref_mut(), wanted, beside)?
            };
        }
        self.add(triangle);
        Ok(())
    }

    /// A vertex that is known already, by how far back it is.
    fn known(&mut self, coder: &mut impl Coder, rows: &Rows, vertex: Option<u32>) -> Result<u32, &'static str> {
        let count = rows.count();
        let back = coder.number(&mut self.number, vertex.map_or(0, |v| count - 1 - v));
        count.checked_sub(1).and_then(|last| last.checked_sub(back)).ok_or("a vertex before the first")
    }

    fn edge(
        &mut self,
        coder: &mut impl Coder,
        rows: &mut Rows,
        mut truth: Option<&mut BaseTruth>,
        (a, b, opposite): (u32, u32, u32),
    ) -> Result<(), &'static str> {
        if !self.close(a, b) {
            // Another triangle has closed it meanwhile.
            return Ok(());
        }
        let (left, right) = (self.newest(a, true), self.newest(b, false));
        let wanted = truth.as_deref_mut().and_then(|t| t.take(b, a));
        let coded = truth.as_deref().zip(wanted).map(|(t, v)| t.coded[v as usize]);
        let kind = match coded {
            None => Across::Nothing,
            Some(NONE) => Across::NewVertex,
            Some(c) if Some(c) == left => Across::Left,
            Some(c) if Some(c) == right => Across::Right,
            Some(_) => Across::Known,
        };
        let class = |v: u32| usize::from(self.fullness[v as usize]).min(FULLNESS - 1);
        let context = class(a) * FULLNESS + class(b);
        let kind = ACROSS[coder.symbol(&mut self.across[context], kind as u32) as usize & 7];
        let third = match kind {
            Across::Nothing => {
                // The edge stays a border; only here, so nothing is said of it again.
                return Ok(());
            }
            Across::NewVertex => self.vertex(coder, rows, truth, wanted, Some((a, b, opposite)))?,
            Across::Left => left.ok_or("no vertex before the edge")?,
            Across::Right => right.ok_or("no vertex after the edge")?,
            Across::Known => self.known(coder, rows, coded)?,
        };
        self.add_across(a, b, third);
        Ok(())
    }

    /// A vertex of its own; `beside` is the edge it lies across and the vertex opposite.
    fn vertex(
        &mut self,
        coder: &mut impl Coder,
        rows: &mut Rows,
        truth: Option<&mut BaseTruth>,
        wanted: Option<u32>,
        beside: Option<(u32, u32, u32)>,
    ) -> Result<u32, &'static str> {
        let v = rows.count();
        if v >= self.vertex_total {
            return Err("more vertices than the table announces");
        }
        let shared = truth.as_deref().zip(wanted).and_then(|(t, w)| t.first_there(w));
        let mut seam = None;
        if rows.has_seams {
            let back = coder.number(&mut self.seam, shared.map_or(0, |c| v - c));
            if back > 0 {
                seam = Some(v.checked_sub(back).ok_or("a seam to a vertex before the first")?);
            }
        }
        let width = rows.width;
        let mut predicted: Vec<i64> = match beside {
            None => match v.checked_sub(1) {
                Some(last) => (0..width).map(|k| rows.value(last, k)).collect(),
                None => vec![0; width],
            },
            Some((a, b, o)) => (0..width)
                .map(|k| {
                    let (a, b, o) = (rows.value(a, k), rows.value(b, k), rows.value(o, k));
                    if k < 3 { a + b - o } else { (a + b) >> 1 }
                })
                .collect(),
        };
        let own = truth.as_deref().zip(wanted).map(|(t, w)| rows.coarse(t.rows.row(w)).collect::<Vec<_>>());
        if let Some(p) = seam {
            (0..3).for_each(|k| predicted[k] = rows.value(p, k));
            rows.seams.push((v, p));
        }
        let scale = match beside {
            Some((a, b, o)) => {
                (0..3).map(|k| (rows.value(a, k) + rows.value(b, k) - 2 * rows.value(o, k)).abs()).sum::<i64>() / 4
            }
            None => FAR,
        };
        self.rows.code(coder, rows, own.as_deref(), &predicted, if seam.is_some() { 0 } else { scale });
        if seam.is_some_and(|p| rows.row(p)[..3] != rows.row(v)[..3]) {
            return Err("a seam between different positions");
        }
        if let Some((t, w)) = truth.zip(wanted) {
            t.know(w, v);
            t.vertex_order.push(w);
        }
        self.into.push(Vec::new());
        self.out_of.push(Vec::new());
        self.fullness.push(0);
        Ok(v)
    }

    fn add(&mut self, triangle: [u32; 3]) {
        self.triangles.push(triangle);
        for k in 0..3 {
            let (a, b, c) = (triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]);
            self.fullness[a as usize] = self.fullness[a as usize].saturating_add(1);
            // An edge that closes another opens none.
            if !self.close(b, a) {
                self.open_edge(a, b, c);
            }
        }
    }
    /// The triangle across the edge (a, b), which is closed already.
    fn add_across(&mut self, a: u32, b: u32, third: u32) {
        let triangle = [b, a, third];
        self.triangles.push(triangle);
        triangle.iter().for_each(|&v| self.fullness[v as usize] = self.fullness[v as usize].saturating_add(1));
        for (x, y, z) in [(a, third, b), (third, b, a)] {
            if !self.close(y, x) {
                self.open_edge(x, y, z);
            }
        }
    }
    fn open_edge(&mut self, a: u32, b: u32, opposite: u32) {
        *self.open.entry((a, b)).or_insert(0) += 1;
        self.queue.push_back((a, b, opposite));
        self.out_of[a as usize].push(b);
        self.into[b as usize].push(a);
    }
    fn close(&mut self, a: u32, b: u32) -> bool {
        match self.open.get_mut(&(a, b)) {
            Some(count) if *count > 1 => *count -= 1,
            Some(_) => drop(self.open.remove(&(a, b))),
            None => return false,
        }
        true
    }
    /// The other end of the newest open edge that ends (`into`) or begins at `v`.
    fn newest(&mut self, v: u32, into: bool) -> Option<u32> {
        loop {
            let list = if into { &mut self.into[v as usize] } else { &mut self.out_of[v as usize] };
            let other = *list.last()?;
            if self.open.contains_key(&if into { (other, v) } else { (v, other) }) {
                return Some(other);
            }
            list.pop();
        }
    }
}
