//! Where a vertex may split: every way to give an arc of its triangles to a new vertex, weighed by factors that learn.
//!
//! The chance of a way is in proportion to its weight, a product of table entries: of each neighbour's as a cut or inside the arc (its
//! distance, valence, state, age, and the dihedral angle there), and of the arc's by length. "No split" is one more way. Whether
//! there is a split needs no more than that, and most vertices have none; which it is also depends on the arc's angle and
//! on where its middle and its ends lie. Entries learn by gradient ascent of the logarithm of the likelihood.

use super::center::{Center, SIDES, Side, Way};
use super::float::{arccos, larger, ln, smaller};
use super::mixer::chance_of_no;
use super::vector::{Vector, add, cross, dot, scale, sub};
use crate::range::Coder;

const LENGTHS: usize = 16;
const VALENCES: usize = 10;
const STATES: usize = 3;
const KINDS: usize = LENGTHS * VALENCES * STATES;
const BENDS: usize = 16;
const AGES: usize = 10;
const RUNS: usize = STATES * STATES * STATES;
const ANGLES: usize = 25;
const OFFSETS: usize = 14;
/// Things that speak against a split.
const NO: usize = 6;
/// Room for the neighbours twice over, and one more.
pub(super) const TWICE: usize = 2 * SIDES + 2;
/// Bounds of an entry, of a neighbour's product and of an arc's: so no product overflows.
pub(super) const ENTRY: f32 = 1e3;
const PRODUCT: f32 = 1e8;
pub(super) const ARC: f32 = 1e12;
/// The middle of an arc and the vertex itself: 1 / (neighbours + 1), by triangles.
const SHARES: [f32; SIDES + 1] = {
    let mut shares = [0.0; SIDES + 1];
    let mut i = 0;
    while i <= SIDES {
        shares[i] = 1.0 / (i as f32 + 2.0);
        i += 1;
    }
    shares
};

/// Entries for a left cut, a right cut, inside, and against any split.
pub(super) type Roles = [f32; 4];

/// Scratch: by neighbour, a closed fan's twice over.
#[derive(Clone, Debug)]
pub(super) struct Fan {
    /// In parts of the mean edge.
    arms: [Vector<f32>; TWICE],
    /// Their squares.
    squares: [f32; TWICE],
    pub(super) factors: [Roles; TWICE],
    /// It is not new in this level.
    pub(super) free: [bool; TWICE],
    /// Entry of its kind, bend, age, and the states about it.
    pub(super) at: [[u16; 4]; SIDES],
}

impl Default for Fan {
    fn default() -> Self {
        Self {
            arms: [[0.0; 3]; TWICE],
            squares: [0.0; TWICE],
            factors: [[1.0; 4]; TWICE],
            free: [false; TWICE],
            at: [[0; 4]; SIDES],
        }
    }
}

/// What the tables say of a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Ways {
    /// There is a way.
    pub(super) any: bool,
    pub(super) total: f32,
    /// The chance that there is a split.
    pub(super) chance: f32,
    /// The same in the logistic domain.
    pub(super) opinion: f32,
    ratio: f32,
    /// The chance of one more, as far as the ways beside the one taken say, in the logistic domain.
    pub(super) rest: f32,
    pub(super) no: [usize; NO],
    pub(super) fan: Box<Fan>,
    /// Of the vertex itself: its edges' root mean square, its normal.
    pub(super) edge: f32,
    pub(super) normal: Vector<f32>,
    pub(super) mean_length: usize,
    pub(super) fresh: usize,
    /// Neighbours that are not new, from the first on at which an arc may begin.
    pub(super) free: usize,
    /// Once there is a split: its ways.
    pub(super) ways: Vec<Listed>,
    /// Sums of their weights, each with those before.
    pub(super) sums: Vec<f32>,
}

/// A way, its entries for angle, offset and chord, and its weight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Listed {
    pub(super) way: Way,
    pub(super) own: [u8; 3],
    pub(super) weight: f32,
}

impl Ways {
    /// Codes which of the ways it is, by halves, chances in proportion to the weights.
    fn by_halves(&self, coder: &mut impl Coder, truth: usize) -> usize {
        let (mut low, mut high) = (0, self.ways.len());
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            let [first, half, last] = [low, middle, high].map(|i| if i == 0 { 0.0 } else { self.sums[i - 1] });
            let yes = if last > first { (last - half) / (last - first) } else { 0.5 };
            if coder.choose(chance_of_no(yes), truth >= middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// The tables.
#[derive(Clone, Debug)]
pub(super) struct WayModel {
    pub(super) kind: Vec<Roles>,
    pub(super) bend: [Roles; BENDS],
    pub(super) age: [Roles; AGES * STATES],
    pub(super) run: [Roles; RUNS],
    pub(super) arc: Vec<f32>,
    /// By what a seam says: kinds of ways.
    pub(super) seam: [[f32; 4]; 4],
    pub(super) no: [Vec<f32>; NO],
    pub(super) seen: f32,
    pub(super) lessons: u32,
    pub(super) angle: [f32; ANGLES],
    pub(super) offset: [f32; OFFSETS],
    pub(super) chord: [f32; OFFSETS],
    pub(super) splits: f32,
}

fn class(x: f32, limit: usize) -> usize {
    (x as i32).clamp(0, limit as i32 - 1) as usize
}

/// A class of a number by about its logarithm, 2^`fine` classes an octave; 1 is the first of its octave, `one` octaves up. `x` is not
/// negative.
#[inline(always)]
fn octaves(x: f32, fine: u32, one: i32, limit: usize) -> usize {
    let whole = x.to_bits() as i32 >> (23 - fine);
    (whole - ((127 - one) << fine)).clamp(0, limit as i32 - 1) as usize
}

#[inline(always)]
pub(super) fn times(a: Roles, b: Roles) -> Roles {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}
/// Each between 1 / `limit` and `limit`.
#[inline(always)]
pub(super) fn within(a: Roles, limit: f32) -> Roles {
    let bounded = |x: f32| larger(smaller(x, limit), 1.0 / limit);
    [bounded(a[0]), bounded(a[1]), bounded(a[2]), bounded(a[3])]
}
impl WayModel {
    pub(super) fn new() -> Self {
        let mut arc = vec![0.0; 4 * SIDES * SIDES];
        for (i, a) in arc.iter_mut().enumerate() {
            let moved = (i % SIDES) as f32;
            *a = larger(super::float::exp(-0.075 * (moved - 4.0) * (moved - 4.0)), 1.0 / ENTRY);
        }
        let even = [1.0; 4];
        Self {
            kind: vec![even; KINDS],
            bend: [even; BENDS],
            age: [even; AGES * STATES],
            run: [even; RUNS],
            arc,
            seam: [[1.0; 4]; 4],
            no: std::array::from_fn(|i| vec![if i == 0 { 20.0 } else { 1.0 }; SIDES]),
            seen: 0.0,
            lessons: 0,
            angle: [1.0; ANGLES],
            offset: [1.0; OFFSETS],
            chord: [1.0; OFFSETS],
            splits: 0.0,
        }
    }

    /// Bytes of the tables.
    pub(super) fn memory_bytes(&self) -> usize {
        let no: usize = self.no.iter().map(Vec::len).sum();
        size_of::<Roles>() * self.kind.len() + 4 * (self.arc.len() + no)
    }
    /// Weighs all ways of `c`, as far as the question needs it whether there is a split. O(neighbours²).
    pub(super) fn weigh(&self, c: &Center, out: &mut Ways) {
        let around = c.neighbours();
        let n = around.len();
        let triangles = if c.closed { n } else { n - 1 };
        let Fan { arms, squares, factors, free, at } = &mut *out.fan;
        let edges: f32 = around.iter().map(|x| x.edge).sum();
        let mean = larger((2.0 * c.edge + edges) / (n as f32 + 2.0), 1e-6);
        // In parts of the mean edge.
        let unit = 1.0 / mean;
        let mut all = 0.0;
        // States, with that of the neighbour before the first and after the last.
        let mut states = [1; SIDES + 2];
        let per_neighbour = arms.iter_mut().zip(squares.iter_mut()).zip(free.iter_mut()).zip(&mut states[1..]);
        for (x, (((arm, square), free), state)) in around.iter().zip(per_neighbour) {
            *arm = scale(sub(x.position, c.position), unit);
            *square = dot(*arm, *arm);
            all += *square;
            *free = x.state != 2;
            *state = x.state;
        }
        (arms[n], squares[n]) = (arms[0], squares[0]);
        if c.closed {
            (states[0], states[n + 1]) = (states[n], states[1]);
        }
        out.edge = mean * (all / n as f32).sqrt();
        // Normals of the triangles before each neighbour and after the last, and the squares of their lengths.
        let mut normals = [([0.0; 3], 0.0); SIDES + 1];
        let mut normal = [0.0; 3];
        for (ends, (here, area)) in arms[..triangles + 1].windows(2).zip(&mut normals[1..]) {
            *here = cross(ends[0], ends[1]);
            *area = dot(*here, *here);
            normal = add(normal, *here);
        }
        normals[0] = normals[triangles];
        out.normal = super::site::unit(normal);
        let mut sum = 0usize;
        out.fresh = 0;
        let mut against = 1.0;
        let known = around.iter().zip(&squares[..n]).zip(normals.windows(2)).zip(states.windows(3));
        for (i, (((x, square), normals), states)) in known.enumerate() {
            let long = octaves(*square, 1, 4, LENGTHS);
            sum += long;
            let [(one, first), (other, second)] = [normals[0], normals[1]];
            // The sine's square, or more than 1 beyond a right angle; 0 for what is not a number.
            let (d, q) = (dot(one, other), first * second);
            let sine = if d > 0.0 { q - d * d } else { q + d * d };
            let bend = octaves(larger(0.0, sine / larger(q, 1e-30)), 0, 13, BENDS - 1);
            let bend = if c.closed || (i > 0 && i < triangles) { bend } else { BENDS - 1 };
            let [before, own, after] = [states[0], states[1], states[2]].map(usize::from);
            out.fresh += usize::from(own == 2);
            let run = (before * 3 + own) * 3 + after;
            let kind = (long * VALENCES + usize::from(x.valence.clamp(3, 12) - 3)) * STATES + own;
            let age = usize::from(x.age).min(AGES - 1) * STATES + own;
            at[i] = [kind as u16, bend as u16, age as u16, run as u16];
            let (k, b, a, r) = (self.kind[kind], self.bend[bend], self.age[age], self.run[run]);
            let product = within(times(times(k, b), times(a, r)), PRODUCT);
            against = larger(smaller(against * product[3], PRODUCT), 1.0 / PRODUCT);
            // No arc ends at what is new, or goes over it.
            factors[i] = if own == 2 { [0.0; 4] } else { product };
        }
        if c.closed {
            factors.copy_within(0..n, n);
            free.copy_within(0..n, n);
        }
        out.mean_length = sum / n;
        let seam = &self.seam[c.seam as usize];
        let kind = usize::from(!c.closed);
        let arcs = self.arcs(kind, n);
        let mut total = 0.0;
        out.any = false;
        out.free = free[c.first.min(n)..n].iter().filter(|f| **f).count();
        for from in c.first..n {
            if !free[from] {
                continue;
            }
            let mut inner = factors[from][0];
            // A closed fan keeps a triangle.
            let end = if c.closed { from + n } else { n };
            let mut row = 0.0;
            for (f, arc) in factors[from + 1..end].iter().zip(&arcs[1..]) {
                row += inner * f[1] * arc;
                inner = smaller(inner * f[2], ARC);
            }
            total += row * seam[kind];
            out.any |= from + 1 < end && free[from + 1];
        }
        if !c.closed {
            // Along the boundary.
            if c.first == 0 {
                let (mut inner, mut heads) = (1.0, 0.0);
                for (f, arc) in factors[..n].iter().zip(self.arcs(2, n)) {
                    heads += inner * f[1] * arc;
                    inner = smaller(inner * f[2], ARC);
                }
                total += heads * seam[2];
            }
            let (mut inner, mut tails) = (1.0, 0.0);
            for (f, arc) in factors[c.first.min(n)..n].iter().rev().zip(self.arcs(3, n)) {
                tails += inner * f[0] * arc;
                inner = smaller(inner * f[2], ARC);
            }
            total += tails * seam[3];
            out.any |= c.first == 0 && free[0] || c.first < n && free[n - 1];
        }
        out.total = total;
        out.no = [n, out.mean_length, out.fresh, c.age, c.splits, c.seam as usize].map(|x| x.min(SIDES - 1));
        let no: f32 = (0..NO).map(|i| self.no[i][out.no[i]]).product::<f32>() * against;
        out.chance = total / (total + no);
        out.ratio = total / no;
        out.opinion = ln(larger(total / no, 1e-9)).clamp(-8.0, 8.0);
    }

    /// Codes which way a vertex splits; `None` if there is none, which no encoder takes.
    pub(super) fn choose(&mut self, coder: &mut impl Coder, c: &Center, out: &mut Ways, truth: Option<Way>) -> Option<Way> {
        self.list(c, out);
        let index = truth.and_then(|t| out.ways.iter().position(|w| w.way == t)).unwrap_or(0);
        out.sums.clear();
        let mut sum = 0.0;
        out.sums.extend(out.ways.iter().map(|w| {
            sum += w.weight;
            sum
        }));
        let taken = out.by_halves(coder, index);
        self.learn_way(out, taken);
        let way = out.ways.get(taken)?.way;
        // Ways that could come after this one: those beside its arc.
        let (from, to) = way.range();
        let beside = |w: &&Listed| {
            let (a, b) = w.way.range();
            a >= to && b <= from + c.count || b <= from
        };
        let rest: f32 = out.ways.iter().filter(beside).map(|w| w.weight).sum();
        out.rest = ln(larger(rest / larger(sum, 1e-30) * out.ratio, 1e-9)).clamp(-8.0, 8.0);
        Some(way)
    }

    /// Lists all ways with their weights. O(neighbours²).
    fn list(&self, c: &Center, out: &mut Ways) {
        let n = c.count;
        let triangles = if c.closed { n } else { n - 1 };
        let Fan { arms, squares, factors, free, .. } = &mut *out.fan;
        let mut angles = [0.0; TWICE];
        let mut all = 0.0;
        for i in 0..triangles {
            angles[i] = arccos(dot(arms[i], arms[i + 1]) / larger((squares[i] * squares[i + 1]).sqrt(), 1e-12));
            all += angles[i];
        }
        let per_angle = (ANGLES - 1) as f32 / larger(all, 1e-6);
        angles[..triangles].iter_mut().for_each(|a| *a *= per_angle);
        if c.closed {
            arms.copy_within(0..n, n);
            angles.copy_within(0..n, n);
        }
        out.ways.clear();
        // Scaled down, so that no product overflows.
        let seam = self.seam[c.seam as usize].map(|s| 1e-9 * s);
        let listed = |way: (Side, usize, usize), weight: f32, angle: f32, middle: Vector<f32>, chord: f32| {
            let (side, from, to) = way;
            let share = SHARES[to - from];
            let (angle, offset) = (class(angle, ANGLES), octaves(dot(middle, middle) * (share * share), 1, 5, OFFSETS));
            let chord = octaves(chord, 1, 4, OFFSETS);
            let weight = weight * self.angle[angle] * (self.offset[offset] * self.chord[chord]);
            Listed { way: Way { side, from: from as u8, to: to as u8 }, own: [angle as u8, offset as u8, chord as u8], weight }
        };
        let kind = usize::from(!c.closed);
        let arcs = self.arcs(kind, n);
        for from in c.first..n {
            if !free[from] {
                continue;
            }
            let start = arms[from];
            let (mut inner, mut angle, mut middle) = (factors[from][0], 0.0, start);
            let end = if c.closed { from + n } else { n };
            for to in from + 1..end {
                if !free[to] {
                    break;
                }
                angle += angles[to - 1];
                middle = add(middle, arms[to]);
                let chord = sub(start, arms[to]);
                let weight = inner * factors[to][1] * (arcs[to - from] * seam[kind]);
                out.ways.push(listed((Side::Inside, from, to), weight, angle, middle, dot(chord, chord)));
                inner = smaller(inner * factors[to][2], ARC);
            }
        }
        if c.closed {
            return;
        }
        let (mut inner, mut angle, mut middle) = (1.0, 0.0, [0.0; 3]);
        for to in 0..if c.first == 0 { n } else { 0 } {
            if !free[to] {
                break;
            }
            angle += if to > 0 { angles[to - 1] } else { 0.0 };
            middle = add(middle, arms[to]);
            let weight = inner * factors[to][1] * (self.arcs(2, n)[to] * seam[2]);
            out.ways.push(listed((Side::Head, 0, to), weight, angle, middle, 0.0));
            inner = smaller(inner * factors[to][2], ARC);
        }
        let (mut inner, mut angle, mut middle) = (1.0, 0.0, [0.0; 3]);
        for from in (c.first..n).rev() {
            if !free[from] {
                break;
            }
            angle += if from + 1 < n { angles[from] } else { 0.0 };
            middle = add(middle, arms[from]);
            let weight = inner * factors[from][0] * (self.arcs(3, n)[n - 1 - from] * seam[3]);
            out.ways.push(listed((Side::Tail, from, n - 1), weight, angle, middle, 0.0));
            inner = smaller(inner * factors[from][2], ARC);
        }
    }

    /// Entries of arcs by their triangles, in a fan of so many neighbours.
    #[inline(always)]
    pub(super) fn arcs(&self, kind: usize, n: usize) -> &[f32] {
        &self.arc[(kind * SIDES + n) * SIDES..][..n]
    }
}
