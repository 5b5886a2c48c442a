//! Where a vertex may split: every way to give an arc of its triangles to a new vertex, weighed by factors that learn.
//!
//! The chance of a way is in proportion to its weight, a product of table entries: of each neighbour's as a cut or inside the arc (its
//! distance, valence, state, age, and the dihedral angle there), and of the arc's by length. "No split" is one more way. Whether
//! there is a split needs no more than that, and most vertices have none; which it is also depends on the arc's angle and
//! on where its middle and its ends lie. Entries learn by gradient ascent of the logarithm of the likelihood.

use super::float::{arccos, larger, ln, log2, smaller};
use super::mixer::chance_of_no;
use super::site::unit;
use super::vector::{Vector, add, cross, dot, length, sub};
use crate::range::Coder;

/// Vertices with more triangles are never split. A simplifier keeps to 18 for the two ends of a collapse; splits of neighbours that
/// come first add some.
pub(super) const VALENCE_LIMIT: usize = 32;

const LENGTHS: usize = 16;
const VALENCES: usize = 10;
const STATES: usize = 3;
const KINDS: usize = LENGTHS * VALENCES * STATES;
const BENDS: usize = 13;
const AGES: usize = 6;
const RUNS: usize = STATES * STATES * STATES;
const ANGLES: usize = 25;
const OFFSETS: usize = 14;
/// A chance of a split below which none is no news.
const CLEAR: f32 = 0.04;
/// Things that speak against a split.
const NO: usize = 6;
const SIDES: usize = VALENCE_LIMIT + 2;
/// Room for the neighbours twice over, and one more.
const TWICE: usize = 2 * SIDES + 2;
/// Bounds of an entry, of a neighbour's product and of an arc's: so no product overflows.
const ENTRY: f32 = 1e3;
const PRODUCT: f32 = 1e8;
const ARC: f32 = 1e12;
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

/// Which triangles a new vertex takes: an arc inside the fan, or one that begins or ends at the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// From one neighbour to another: two new triangles.
    #[default]
    Inside,
    /// From the fan's clockwise end: one new triangle.
    Head,
    /// To the fan's counter-clockwise end: one new triangle.
    Tail,
}

/// One way to split: neighbours `from` to `to` become the new vertex's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Way {
    pub(super) side: Side,
    pub(super) from: u8,
    /// Beyond the number of neighbours where it runs past the fan's start.
    pub(super) to: u8,
}

impl Way {
    pub(super) fn range(self) -> (usize, usize) {
        (usize::from(self.from), usize::from(self.to))
    }
    /// Its kind: whether it lies in a closed fan, in an open one, or along the boundary.
    fn kind(self, closed: bool) -> usize {
        match self.side {
            Side::Inside => usize::from(!closed),
            Side::Head => 2,
            Side::Tail => 3,
        }
    }
}

/// What is known of a neighbour.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbour {
    pub(super) vertex: u32,
    pub(super) position: Vector<f32>,
    /// Mean edge length there.
    pub(super) edge: f32,
    pub(super) valence: usize,
    /// 0: its own splits are to come; 1: they are known; 2: new in this level.
    pub(super) state: usize,
    /// Levels since it came.
    pub(super) age: usize,
}

/// A vertex that may split, and its neighbours counter-clockwise.
#[derive(Clone, Debug)]
pub(super) struct Center {
    pub(super) position: Vector<f32>,
    pub(super) count: usize,
    around: [Neighbour; SIDES],
    pub(super) closed: bool,
    pub(super) age: usize,
    /// Splits of it in this level so far.
    pub(super) splits: usize,
    /// First neighbour at which an arc may begin.
    pub(super) first: usize,
    /// What is known of a seam through here.
    pub(super) seam: Seam,
}

impl Default for Center {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            count: 0,
            around: [Neighbour::default(); SIDES],
            closed: false,
            age: 0,
            splits: 0,
            first: 0,
            seam: Seam::Quiet,
        }
    }
}

impl Center {
    pub(super) fn push(&mut self, neighbour: Neighbour) {
        self.around[self.count] = neighbour;
        self.count += 1;
    }
    pub(super) fn neighbours(&self) -> &[Neighbour] {
        &self.around[..self.count]
    }
}

/// What another wedge at the position of a vertex says of its splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Seam {
    /// None has split along the boundary, or all that did have their counterparts.
    #[default]
    Quiet,
    /// One has split at its fan's clockwise end, and waits for a counterpart.
    Head,
    /// One at the other end.
    Tail,
    /// This vertex has: the mesh may go on across.
    Own,
}

/// Entries for a left cut, a right cut, inside; the fourth is room for vector instructions.
type Roles = [f32; 4];

/// Scratch: by neighbour, a closed fan's twice over.
#[derive(Clone, Debug)]
struct Fan {
    arms: [Vector<f32>; TWICE],
    sizes: [f32; TWICE],
    factors: [Roles; TWICE],
    /// It is not new in this level.
    free: [bool; TWICE],
    /// Entry of its kind, bend, age, and the states about it.
    at: [[u16; 4]; SIDES],
}

impl Default for Fan {
    fn default() -> Self {
        Self {
            arms: [[0.0; 3]; TWICE],
            sizes: [0.0; TWICE],
            factors: [[1.0; 4]; TWICE],
            free: [false; TWICE],
            at: [[0; 4]; SIDES],
        }
    }
}

/// What the tables say of a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Ways {
    pub(super) ways: Vec<Way>,
    weights: Vec<f32>,
    total: f32,
    /// The chance that there is a split.
    chance: f32,
    /// The same in the logistic domain.
    pub(super) opinion: f32,
    no: [usize; NO],
    fan: Box<Fan>,
    /// Mean edge length thereabouts.
    unit: f32,
    /// Of the vertex itself.
    pub(super) edge: f32,
    pub(super) normal: Vector<f32>,
    pub(super) mean_length: usize,
    pub(super) most_length: usize,
    pub(super) fresh: usize,
    /// Of each way, once there is a split: its weight, and entries for angle, offset, chord.
    full: Vec<(f32, [u8; 3])>,
    full_total: f32,
}

/// The tables.
#[derive(Clone, Debug)]
pub(super) struct WayModel {
    kind: Vec<Roles>,
    bend: [Roles; BENDS],
    age: [Roles; AGES],
    run: [Roles; RUNS],
    arc: Vec<f32>,
    /// By what a seam says: kinds of ways.
    seam: [[f32; 4]; 4],
    no: [Vec<f32>; NO],
    seen: f32,
    angle: [f32; ANGLES],
    offset: [f32; OFFSETS],
    chord: [f32; OFFSETS],
    splits: f32,
}

fn class(x: f32, limit: usize) -> usize {
    (x as i32).clamp(0, limit as i32 - 1) as usize
}

/// Multiplies an entry by e^step, for small steps.
#[inline(always)]
fn grow(entry: &mut f32, step: f32) {
    let grown = *entry * (1.0 + step * (1.0 + step * (0.5 + step * (1.0 / 6.0))));
    *entry = larger(smaller(grown, ENTRY), 1.0 / ENTRY);
}

/// The rate after so many lessons.
fn rate(seen: f32) -> f32 {
    0.02 * (1.0 + 8.0 / (1.0 + seen / 400.0))
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
            age: [even; AGES],
            run: [even; RUNS],
            arc,
            seam: [[1.0; 4]; 4],
            no: std::array::from_fn(|i| vec![if i == 0 { 20.0 } else { 1.0 }; SIDES]),
            seen: 0.0,
            angle: [1.0; ANGLES],
            offset: [1.0; OFFSETS],
            chord: [1.0; OFFSETS],
            splits: 0.0,
        }
    }

    /// Weighs all ways of `c`, as far as the question needs it whether there is a split. O(neighbours²).
    pub(super) fn weigh(&self, c: &Center, out: &mut Ways) {
        let around = c.neighbours();
        let n = around.len();
        let triangles = if c.closed { n } else { n - 1 };
        let Fan { arms, sizes, factors, free, at } = &mut *out.fan;
        let (mut own, mut others) = (0.0, 0.0);
        for (i, x) in around.iter().enumerate() {
            arms[i] = sub(x.position, c.position);
            sizes[i] = length(arms[i]);
            free[i] = x.state != 2;
            own += sizes[i];
            others += x.edge;
        }
        (arms[n], sizes[n]) = (arms[0], sizes[0]);
        out.edge = own / n as f32;
        out.unit = 1.0 / larger((2.0 * out.edge + others) / (n as f32 + 2.0), 1e-6);
        // Normals of the triangles from each neighbour to the next, and their lengths' reciprocals.
        let (mut normals, mut inverse) = ([[0.0; 3]; SIDES], [0.0; SIDES]);
        let mut normal = [0.0; 3];
        for i in 0..triangles {
            normals[i] = cross(arms[i], arms[i + 1]);
            normal = add(normal, normals[i]);
            let l = length(normals[i]);
            inverse[i] = if l > 1e-12 { 1.0 / l } else { 0.0 };
        }
        out.normal = unit(normal);
        let (mut sum, mut most) = (0usize, 0usize);
        out.fresh = 0;
        let scale = out.unit * out.unit;
        for (i, x) in around.iter().enumerate() {
            let (before, after) = (if i == 0 { n - 1 } else { i - 1 }, if i + 1 == n { 0 } else { i + 1 });
            // Six classes in a factor of e.
            let long = class(2.079_44 * log2(larger(sizes[i] * sizes[i] * scale, 1e-6)) + 8.0, LENGTHS);
            sum += long;
            most = most.max(long);
            out.fresh += usize::from(x.state == 2);
            let bend = if c.closed || (i > 0 && i < triangles) {
                let cosine = dot(normals[before], normals[i]) * inverse[before] * inverse[i];
                class(0.831_78 * log2(larger(1.0 - cosine, 0.0) + 1e-4) + 12.0, BENDS)
            } else {
                BENDS - 1
            };
            let state = |j: usize, there: bool| if c.closed || there { around[j].state } else { 1 };
            let run = (state(before, i > 0) * 3 + x.state) * 3 + state(after, i + 1 < n);
            let kind = (long * VALENCES + x.valence.clamp(3, 12) - 3) * STATES + x.state;
            let age = x.age.min(AGES - 1);
            at[i] = [kind as u16, bend as u16, age as u16, run as u16];
            let (k, b, a, r) = (&self.kind[kind], &self.bend[bend], &self.age[age], &self.run[run]);
            factors[i] = std::array::from_fn(|j| smaller(larger(k[j] * b[j] * (a[j] * r[j]), 1.0 / PRODUCT), PRODUCT));
        }
        if c.closed {
            factors.copy_within(0..n, n);
            free.copy_within(0..n, n);
        }
        out.mean_length = sum / n;
        out.most_length = most;
        out.ways.clear();
        out.weights.clear();
        let seam = &self.seam[c.seam as usize];
        let mut total = 0.0;
        let mut push = |side: Side, kind: usize, (from, to): (usize, usize), weight: f32| {
            let weight = weight * self.arc[(kind * SIDES + n) * SIDES + to - from] * seam[kind];
            total += weight;
            out.ways.push(Way { side, from: from as u8, to: to as u8 });
            out.weights.push(weight);
        };
        let inside = usize::from(!c.closed);
        for from in c.first..n {
            if !free[from] {
                continue;
            }
            let mut inner = factors[from][0];
            // A closed fan keeps a triangle.
            let end = if c.closed { from + n } else { n };
            for to in from + 1..end {
                if !free[to] {
                    break;
                }
                push(Side::Inside, inside, (from, to), inner * factors[to][1]);
                inner = smaller(inner * factors[to][2], ARC);
            }
        }
        if !c.closed {
            // Along the boundary.
            let mut inner = 1.0;
            for to in 0..n {
                if c.first > 0 || !free[to] {
                    break;
                }
                push(Side::Head, 2, (0, to), inner * factors[to][1]);
                inner = smaller(inner * factors[to][2], ARC);
            }
            let mut inner = 1.0;
            for from in (c.first..n).rev() {
                if !free[from] {
                    break;
                }
                push(Side::Tail, 3, (from, n - 1), inner * factors[from][0]);
                inner = smaller(inner * factors[from][2], ARC);
            }
        }
        out.total = total;
        out.no = [n, out.mean_length, out.fresh, c.age, c.splits, c.seam as usize].map(|x| x.min(SIDES - 1));
        let no: f32 = (0..NO).map(|i| self.no[i][out.no[i]]).product();
        out.chance = total / (total + no);
        out.opinion = ln(larger(total / no, 1e-9)).clamp(-8.0, 8.0);
    }

    /// Weighs the ways of a vertex of which it is known that it splits, and codes which it is, by halves.
    pub(super) fn choose(&self, coder: &mut impl Coder, c: &Center, out: &mut Ways, truth: usize) -> usize {
        let n = c.count;
        let triangles = if c.closed { n } else { n - 1 };
        let Fan { arms, sizes, .. } = &mut *out.fan;
        let mut angles = [0.0; TWICE];
        let mut total_angle = 0.0;
        for i in 0..triangles {
            angles[i] = arccos(dot(arms[i], arms[i + 1]) / larger(sizes[i] * sizes[i + 1], 1e-12));
            total_angle += angles[i];
        }
        if c.closed {
            arms.copy_within(0..n, n);
            angles.copy_within(0..n, n);
        }
        let per_angle = (ANGLES - 1) as f32 / larger(total_angle, 1e-6);
        let unit = out.unit;
        out.full.clear();
        out.full_total = 0.0;
        // Ways are listed so that most of them go on where the one before ended.
        let (mut angle, mut middle) = (0.0, [0.0; 3]);
        let mut before = Way { side: Side::Inside, from: u8::MAX, to: u8::MAX };
        for (way, weight) in out.ways.iter().zip(&out.weights) {
            let (from, to) = way.range();
            let goes_on = way.side == before.side
                && match way.side {
                    Side::Tail => way.from + 1 == before.from,
                    _ => way.from == before.from && way.to == before.to.wrapping_add(1),
                };
            if goes_on {
                let (new, gap) = if way.side == Side::Tail { (from, from) } else { (to, to - 1) };
                middle = add(middle, arms[new]);
                angle += angles[gap];
            } else {
                middle = arms[from..=to].iter().fold([0.0; 3], |s, &a| add(s, a));
                angle = angles[from..to].iter().sum();
            }
            before = *way;
            let chord = match way.side {
                Side::Inside => class(5.0 * unit * length(sub(arms[from], arms[to])), OFFSETS),
                _ => 0,
            };
            let own = [
                class(per_angle * angle, ANGLES),
                class(10.0 * unit * length(middle) * SHARES[to - from], OFFSETS),
                chord,
            ];
            // Scaled down, so that no product overflows.
            let full = weight * 1e-6 * self.angle[own[0]] * (self.offset[own[1]] * self.chord[own[2]] * 1e-3);
            out.full_total += full;
            out.full.push((full, own.map(|x| x as u8)));
        }
        let (mut low, mut high) = (0, out.full.len());
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            let left: f32 = out.full[low..middle].iter().map(|w| w.0).sum();
            let right: f32 = out.full[middle..high].iter().map(|w| w.0).sum();
            let yes = if left + right > 0.0 { right / (left + right) } else { 0.5 };
            if coder.choose(chance_of_no(yes), truth >= middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }

    /// Learns what happened: the way taken, or no split.
    pub(super) fn learn(&mut self, c: &Center, ways: &Ways, taken: Option<usize>) {
        // What was clear beforehand teaches little.
        if taken.is_none() && ways.chance < CLEAR {
            return;
        }
        let n = c.count;
        let rate_now = rate(self.seen);
        self.seen += 1.0;
        let each = if ways.total > 0.0 { ways.chance / ways.total } else { 0.0 };
        // How much each neighbour was expected to be a left cut, a right cut, inside; and the arcs by length.
        let mut expected = [[0.0f32; 4]; TWICE];
        let mut arcs = [[0.0f32; SIDES]; 4];
        for (w, (way, weight)) in ways.ways.iter().zip(&ways.weights).enumerate() {
            let step = rate_now * (if taken == Some(w) { 1.0 } else { 0.0 } - weight * each);
            let (from, to) = way.range();
            arcs[way.kind(c.closed)][to - from] += step;
            let (left, right, first, end) = match way.side {
                Side::Inside => (step, step, from + 1, to),
                Side::Head => (0.0, step, 0, to),
                Side::Tail => (step, 0.0, from + 1, n),
            };
            expected[from][0] += left;
            expected[to][1] += right;
            // Inside from here on, up to there.
            expected[first][2] += step;
            expected[end][2] -= step;
        }
        let mut inside = 0.0;
        for e in &mut expected[..2 * n] {
            inside += e[2];
            e[2] = inside;
        }
        if c.closed {
            for i in 0..n {
                (0..3).for_each(|r| expected[i][r] += expected[i + n][r]);
            }
        }
        for (at, steps) in ways.fan.at[..n].iter().zip(&expected) {
            let [kind, bend, age, run] = at.map(usize::from);
            for roles in [&mut self.kind[kind], &mut self.bend[bend], &mut self.age[age], &mut self.run[run]] {
                roles.iter_mut().zip(steps).for_each(|(entry, step)| grow(entry, *step));
            }
        }
        for kind in if c.closed { 0..1 } else { 1..4 } {
            let arcs = &arcs[kind][..n];
            let list = &mut self.arc[(kind * SIDES + n) * SIDES..][..n];
            list.iter_mut().zip(arcs).for_each(|(entry, step)| grow(entry, *step));
            grow(&mut self.seam[c.seam as usize][kind], arcs.iter().sum());
        }
        let step = 0.5 * rate_now * (if taken.is_none() { 1.0 } else { 0.0 } - (1.0 - ways.chance));
        for i in 0..NO {
            grow(&mut self.no[i][ways.no[i]], step);
        }
        if let Some(taken) = taken {
            self.learn_way(ways, taken);
        }
    }

    /// Learns which way was taken.
    fn learn_way(&mut self, ways: &Ways, taken: usize) {
        let rate = rate(self.splits);
        self.splits += 1.0;
        let each = if ways.full_total > 0.0 { rate / ways.full_total } else { 0.0 };
        for (w, (full, own)) in ways.full.iter().enumerate() {
            let step = if taken == w { rate } else { 0.0 } - full * each;
            let [angle, offset, chord] = own.map(usize::from);
            grow(&mut self.angle[angle], step);
            grow(&mut self.offset[offset], step);
            grow(&mut self.chord[chord], step);
        }
    }
}
