//! Where a vertex may split: every way to give an arc of its triangles to a new vertex, weighed by scores that learn.
//!
//! The chance of a way is proportional to e^score (a softmax); a score is a sum of table entries, one for each thing that may
//! matter: lengths, valences, ages and dihedral angles at the two cuts and within the arc, the arc's angle, where its middle
//! lies. "No split" is one more way. Entries learn by gradient ascent of the likelihood.

use super::float::{arccos, exp, larger, ln};
use super::mixer::chance_of_no;
use super::vector::{Vector, add, cross, dot, length, scale, sub};
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
const ANGLES: usize = 25;
const OFFSETS: usize = 14;
/// A chance of a split below which none is no news.
const CLEAR: f32 = 0.04;
/// Things that speak against a split.
const NO: usize = 6;
const SIDES: usize = VALENCE_LIMIT + 2;
/// Room for the neighbours twice over, and one more.
const TWICE: usize = 2 * SIDES + 2;
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) side: Side,
    pub(super) from: usize,
    /// Beyond the number of neighbours where it runs past the fan's start.
    pub(super) to: usize,
}

/// A way and its chance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weighed {
    pub(super) way: Way,
    /// e^score, that of the likeliest made 1.
    weight: f32,
    /// Its own entries: arc by valence, angle, offset, chord.
    own: [u16; 4],
}

/// What is known of a neighbour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Neighbour {
    pub(super) position: Vector<f32>,
    pub(super) valence: usize,
    /// 0: its own splits are to come; 1: they are known; 2: new in this level.
    pub(super) state: usize,
    /// Levels since it came.
    pub(super) age: usize,
}

/// A vertex that may split, and its neighbours counter-clockwise.
#[derive(Clone, Debug, Default)]
pub(super) struct Center {
    pub(super) position: Vector<f32>,
    pub(super) neighbours: Vec<Neighbour>,
    pub(super) closed: bool,
    /// Mean edge length thereabouts.
    pub(super) edge: f32,
    pub(super) age: usize,
    /// Splits of it in this level so far.
    pub(super) splits: usize,
    /// First neighbour at which an arc may begin.
    pub(super) first: usize,
    /// What is known of a seam through here.
    pub(super) seam: Seam,
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

/// Scratch: by neighbour.
#[derive(Clone, Debug)]
struct Fan {
    arms: [Vector<f32>; TWICE],
    sizes: [f32; TWICE],
    /// Of the triangle to the next one.
    normals: [Vector<f32>; TWICE],
    angles: [f32; TWICE],
    /// As left cut, right cut, inside.
    scores: [[f32; 3]; TWICE],
    /// It is not new in this level.
    free: [bool; TWICE],
}

impl Default for Fan {
    fn default() -> Self {
        let (points, numbers) = ([[0.0; 3]; TWICE], [0.0; TWICE]);
        Self { arms: points, sizes: numbers, normals: points, angles: numbers, scores: points, free: [false; TWICE] }
    }
}

/// What the scores say of a vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Ways {
    pub(super) ways: Vec<Weighed>,
    total: f32,
    /// Logarithm of the sum of e^score, less the score of no split.
    pub(super) opinion: f32,
    /// For each neighbour: entry of its kind, bend, age, and the states about it.
    at: Vec<[u16; 4]>,
    no: [usize; NO],
    fan: Box<Fan>,
    pub(super) mean_length: usize,
    pub(super) most_length: usize,
    pub(super) fresh: usize,
}

/// The tables.
#[derive(Clone, Debug)]
pub(super) struct WayModel {
    /// Left cut, right cut, inner.
    kind: [Vec<f32>; 3],
    bend: [[f32; BENDS]; 3],
    age: [[f32; AGES]; 3],
    run: [[f32; 27]; 3],
    arc: Vec<f32>,
    angle: [f32; ANGLES],
    offset: [f32; OFFSETS],
    chord: [f32; OFFSETS],
    no: [Vec<f32>; NO],
    /// By what a seam says: kinds of ways.
    seam: [[f32; 4]; 4],
    seen: f32,
}

fn class(x: f32, limit: usize) -> usize {
    (x as i32).clamp(0, limit as i32 - 1) as usize
}

impl WayModel {
    pub(super) fn new() -> Self {
        let mut arc = vec![0.0; 4 * SIDES * SIDES];
        for (i, a) in arc.iter_mut().enumerate() {
            let moved = (i % SIDES) as f32;
            *a = -0.075 * (moved - 4.0) * (moved - 4.0);
        }
        Self {
            kind: std::array::from_fn(|_| vec![0.0; KINDS]),
            bend: [[0.0; BENDS]; 3],
            age: [[0.0; AGES]; 3],
            run: [[0.0; 27]; 3],
            arc,
            angle: [0.0; ANGLES],
            offset: [0.0; OFFSETS],
            chord: [0.0; OFFSETS],
            no: std::array::from_fn(|i| vec![if i == 0 { 3.0 } else { 0.0 }; SIDES]),
            seam: [[0.0; 4]; 4],
            seen: 0.0,
        }
    }

    /// Weighs all ways of `c`. O(neighbours²).
    pub(super) fn weigh(&self, c: &Center, out: &mut Ways) {
        let n = c.neighbours.len();
        out.ways.clear();
        out.at.clear();
        let unit = 1.0 / larger(c.edge, 1e-6);
        let triangles = if c.closed { n } else { n - 1 };
        // By neighbour; a closed fan twice over, so that no arc wraps around.
        let Fan { arms, sizes, normals, angles, scores, free } = &mut *out.fan;
        for (i, x) in c.neighbours.iter().enumerate() {
            arms[i] = sub(x.position, c.position);
            sizes[i] = length(arms[i]);
            free[i] = x.state != 2;
        }
        arms[n] = arms[0];
        sizes[n] = sizes[0];
        let mut total_angle = 0.0;
        for i in 0..triangles {
            let normal = cross(arms[i], arms[i + 1]);
            let l = length(normal);
            normals[i] = scale(normal, if l > 1e-12 { 1.0 / l } else { 0.0 });
            angles[i] = arccos(dot(arms[i], arms[i + 1]) / larger(sizes[i] * sizes[i + 1], 1e-12));
            total_angle += angles[i];
        }
        let (mut sum, mut most) = (0usize, 0usize);
        out.fresh = 0;
        for i in 0..n {
            let x = &c.neighbours[i];
            let (before, after) = (if i == 0 { n - 1 } else { i - 1 }, if i + 1 == n { 0 } else { i + 1 });
            let long = class(6.0 * ln(larger(sizes[i] * unit, 1e-3)) + 8.0, LENGTHS);
            sum += long;
            most = most.max(long);
            out.fresh += usize::from(x.state == 2);
            let bend = if c.closed || (i > 0 && i < triangles) {
                class(1.2 * ln(larger(1.0 - dot(normals[before], normals[i]), 0.0) + 1e-4) + 12.0, BENDS)
            } else {
                BENDS - 1
            };
            let state = |j: usize, there: bool| if c.closed || there { c.neighbours[j].state } else { 1 };
            let run = (state(before, i > 0) * 3 + x.state) * 3 + state(after, i + 1 < n);
            let kind = (long * VALENCES + x.valence.clamp(3, 12) - 3) * STATES + x.state;
            let age = x.age.min(AGES - 1);
            out.at.push([kind as u16, bend as u16, age as u16, run as u16]);
            for r in 0..3 {
                scores[i][r] = self.kind[r][kind] + self.bend[r][bend] + self.age[r][age] + self.run[r][run];
            }
        }
        if c.closed {
            arms.copy_within(0..n, n);
            angles.copy_within(0..n, n);
            scores.copy_within(0..n, n);
            free.copy_within(0..n, n);
        }
        out.mean_length = sum / n;
        out.most_length = most;
        let seam = &self.seam[c.seam as usize];
        let per_angle = (ANGLES - 1) as f32 / larger(total_angle, 1e-6);
        let mut best = f32::NEG_INFINITY;
        let mut push =
            |kind: usize, (from, to): (usize, usize), score: f32, (angle, middle, chord): (f32, Vector<f32>, usize)| {
                let moved = to - from;
                let side = [Side::Inside, Side::Inside, Side::Head, Side::Tail][kind];
                let own = [
                    ((kind * SIDES + n) * SIDES + moved) as u16,
                    class(per_angle * angle, ANGLES) as u16,
                    class(10.0 * unit * length(middle) * SHARES[moved], OFFSETS) as u16,
                    chord as u16,
                ];
                let score = score + self.own(own) + seam[kind];
                best = larger(best, score);
                out.ways.push(Weighed { way: Way { side, from, to }, weight: score, own });
            };
        let inside = usize::from(!c.closed);
        for from in c.first..n {
            if !free[from] {
                continue;
            }
            let (mut inner, mut angle, mut middle) = (scores[from][0], 0.0, arms[from]);
            // A closed fan keeps a triangle.
            let end = if c.closed { from + n } else { n };
            for to in from + 1..end {
                if !free[to] {
                    break;
                }
                angle += angles[to - 1];
                middle = add(middle, arms[to]);
                let chord = class(5.0 * unit * length(sub(arms[from], arms[to])), OFFSETS);
                push(inside, (from, to), inner + scores[to][1], (angle, middle, chord));
                inner += scores[to][2];
            }
        }
        if !c.closed {
            // Along the boundary.
            let (mut inner, mut angle, mut middle) = (0.0, 0.0, [0.0; 3]);
            for to in 0..n {
                if c.first > 0 || !free[to] {
                    break;
                }
                middle = add(middle, arms[to]);
                angle += if to > 0 { angles[to - 1] } else { 0.0 };
                push(2, (0, to), inner + scores[to][1], (angle, middle, 0));
                inner += scores[to][2];
            }
            let (mut inner, mut angle, mut middle) = (0.0, 0.0, [0.0; 3]);
            for from in (c.first..n).rev() {
                if !free[from] {
                    break;
                }
                middle = add(middle, arms[from]);
                angle += if from + 1 < n { angles[from] } else { 0.0 };
                push(3, (from, n - 1), inner + scores[from][0], (angle, middle, 0));
                inner += scores[from][2];
            }
        }
        out.total = 0.0;
        for w in &mut out.ways {
            w.weight = exp(w.weight - best);
            out.total += w.weight;
        }
        out.no = [n, out.mean_length, out.fresh, c.age, c.splits, c.seam as usize].map(|x| x.min(SIDES - 1));
        let no: f32 = (0..NO).map(|i| self.no[i][out.no[i]]).sum();
        out.opinion = if out.ways.is_empty() { -8.0 } else { (best + ln(out.total) - no).clamp(-8.0, 8.0) };
    }

    #[inline(always)]
    fn own(&self, own: [u16; 4]) -> f32 {
        self.arc[own[0] as usize] + self.angle[own[1] as usize] + self.offset[own[2] as usize] + self.chord[own[3] as usize]
    }

    /// Codes which way it is, by halves.
    pub(super) fn choose(&self, coder: &mut impl Coder, ways: &Ways, truth: usize) -> usize {
        let (mut low, mut high) = (0, ways.ways.len());
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            let left: f32 = ways.ways[low..middle].iter().map(|w| w.weight).sum();
            let right: f32 = ways.ways[middle..high].iter().map(|w| w.weight).sum();
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
        let split = super::float::squash(ways.opinion);
        // What was clear beforehand teaches little.
        if ways.ways.is_empty() || (taken.is_none() && split < CLEAR) {
            return;
        }
        let n = c.neighbours.len();
        let rate = 0.02 * (1.0 + 8.0 / (1.0 + self.seen / 400.0));
        self.seen += 1.0;
        let each = split / ways.total;
        // How much each neighbour was expected to be a left cut, a right cut, inside.
        let mut expected = [[0.0f32; 3]; TWICE];
        for (w, Weighed { way, weight, own }) in ways.ways.iter().enumerate() {
            let g = if taken == Some(w) { 1.0 } else { 0.0 } - weight * each;
            let step = rate * g;
            self.arc[own[0] as usize] += step;
            self.angle[own[1] as usize] += step;
            self.offset[own[2] as usize] += step;
            self.chord[own[3] as usize] += step;
            let (kind, from, to) = match way.side {
                Side::Inside => (usize::from(!c.closed), way.from + 1, way.to),
                Side::Head => (2, 0, way.to),
                Side::Tail => (3, way.from + 1, n),
            };
            self.seam[c.seam as usize][kind] += step;
            if way.side != Side::Head {
                expected[way.from][0] += step;
            }
            if way.side != Side::Tail {
                expected[way.to][1] += step;
            }
            // Inside from here on, up to there.
            expected[from][2] += step;
            expected[to][2] -= step;
        }
        let mut inside = 0.0;
        for e in &mut expected {
            inside += e[2];
            e[2] = inside;
        }
        if c.closed {
            for i in 0..n {
                (0..3).for_each(|r| expected[i][r] += expected[i + n][r]);
            }
        }
        for (i, at) in ways.at.iter().enumerate() {
            for r in 0..3 {
                let step = expected[i][r];
                self.kind[r][at[0] as usize] += step;
                self.bend[r][at[1] as usize] += step;
                self.age[r][at[2] as usize] += step;
                self.run[r][at[3] as usize] += step;
            }
        }
        let step = 0.5 * rate * (if taken.is_none() { 1.0 } else { 0.0 } - (1.0 - split));
        for i in 0..NO {
            self.no[i][ways.no[i]] += step;
        }
    }
}
