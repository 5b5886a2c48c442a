//! What the tables of [`WayModel`] learn from what happened: gradient ascent of the logarithm of the likelihood.

use super::center::{Center, SIDES, Side, Way};
use super::float::{larger, smaller};
use super::options::{ARC, ENTRY, Listed, TWICE, WayModel, Ways, times, within};

/// A chance of a split below which none is no news.
const CLEAR: f32 = 0.2;

/// Lessons after which neighbours' entries are brought back within their bounds: no product overflows in between.
const BOUNDED_EVERY: u32 = 256;

/// e^step, for small steps.
#[inline(always)]
fn growth(step: f32) -> f32 {
    1.0 + step * (1.0 + step * 0.5)
}
/// An entry within its bounds.
#[inline(always)]
fn bounded(entry: f32) -> f32 {
    larger(smaller(entry, ENTRY), 1.0 / ENTRY)
}

/// The rate after so many lessons.
fn rate_after(seen: f32) -> f32 {
    0.012 * (1.0 + 8.0 / (1.0 + seen / 400.0))
}

impl WayModel {
    /// Learns what happened: the way taken, or no split.
    pub(super) fn learn(&mut self, c: &Center, ways: &Ways, taken: Option<Way>) {
        // What was clear beforehand teaches little.
        if taken.is_none() && ways.chance < CLEAR {
            return;
        }
        let n = c.count;
        let rate = rate_after(self.seen);
        self.seen += 1.0;
        self.lessons += 1;
        if self.lessons.is_multiple_of(BOUNDED_EVERY) {
            self.bound();
        }
        let each = if ways.total > 0.0 { -rate * ways.chance / ways.total } else { 0.0 };
        let seam = self.seam[c.seam as usize].map(|s| s * each);
        // How much more than expected each neighbour was a left cut, a right cut, inside (from here on more); arcs by kind and length.
        let mut steps = [[0.0f32; 4]; TWICE];
        let mut arc_steps = [[0.0f32; SIDES]; 4];
        let factors = &ways.fan.factors;
        let kind = usize::from(!c.closed);
        for from in c.first..n {
            if !ways.fan.free[from] {
                continue;
            }
            let (mut inner, mut sum) = (factors[from][0], 0.0);
            let end = if c.closed { from + n } else { n };
            let arcs = self.arcs(kind, n)[1..].iter().zip(&mut arc_steps[kind][1..]);
            for ((f, step), (arc, arc_step)) in factors[from + 1..end].iter().zip(&mut steps[from + 1..end]).zip(arcs) {
                let weight = inner * f[1] * (arc * seam[kind]);
                inner = smaller(inner * f[2], ARC);
                sum += weight;
                *arc_step += weight;
                step[1] += weight;
                step[2] -= weight;
            }
            steps[from][0] += sum;
            steps[from + 1][2] += sum;
        }
        if !c.closed {
            if c.first == 0 {
                let (mut inner, mut sum) = (1.0, 0.0);
                for i in 0..n {
                    let weight = inner * factors[i][1] * (self.arcs(2, n)[i] * seam[2]);
                    inner = smaller(inner * factors[i][2], ARC);
                    sum += weight;
                    arc_steps[2][i] += weight;
                    steps[i][1] += weight;
                    steps[i][2] -= weight;
                }
                steps[0][2] += sum;
            }
            let mut inner = 1.0;
            for from in (c.first..n).rev() {
                let weight = inner * factors[from][0] * (self.arcs(3, n)[n - 1 - from] * seam[3]);
                inner = smaller(inner * factors[from][2], ARC);
                arc_steps[3][n - 1 - from] += weight;
                steps[from][0] += weight;
                steps[from + 1][2] += weight;
                steps[n][2] -= weight;
            }
        }
        if let Some(way) = taken {
            let (from, to) = way.range();
            let (left, right, first, end) = match way.side {
                Side::Inside => (rate, rate, from + 1, to),
                Side::Head => (0.0, rate, 0, to),
                Side::Tail => (rate, 0.0, from + 1, n),
            };
            arc_steps[way.kind(c.closed)][to - from] += rate;
            steps[from][0] += left;
            steps[to][1] += right;
            steps[first][2] += rate;
            steps[end][2] -= rate;
        }
        let mut inside = 0.0;
        for step in &mut steps[..2 * n] {
            inside += step[2];
            step[2] = inside;
        }
        if c.closed {
            for i in 0..n {
                (0..3).for_each(|r| steps[i][r] += steps[i + n][r]);
            }
        }
        let against = 0.5 * rate * (if taken.is_none() { 1.0 } else { 0.0 } - (1.0 - ways.chance));
        for (at, step) in ways.fan.at[..n].iter().zip(&mut steps) {
            step[3] = 0.5 * against;
            let growth = [growth(step[0]), growth(step[1]), growth(step[2]), growth(step[3])];
            let [kind, bend, age, run] = at.map(usize::from);
            for roles in [&mut self.kind[kind], &mut self.bend[bend], &mut self.age[age], &mut self.run[run]] {
                *roles = times(*roles, growth);
            }
        }
        for kind in if c.closed { 0..1 } else { 1..4 } {
            let steps = &arc_steps[kind][..n];
            let list = &mut self.arc[(kind * SIDES + n) * SIDES..][..n];
            list.iter_mut().zip(steps).for_each(|(entry, step)| *entry = bounded(*entry * growth(*step)));
            let entry = &mut self.seam[c.seam as usize][kind];
            *entry = bounded(*entry * growth(steps.iter().sum()));
        }
        let against = growth(against);
        for (table, &at) in self.no.iter_mut().zip(&ways.no) {
            table[at] = bounded(table[at] * against);
        }
    }

    /// Brings entries that grew beyond their bounds back.
    fn bound(&mut self) {
        let tables = [&mut self.kind[..], &mut self.bend, &mut self.age, &mut self.run];
        tables.into_iter().flatten().for_each(|roles| *roles = within(*roles, ENTRY));
    }

    /// Learns which way was taken.
    pub(super) fn learn_way(&mut self, ways: &Ways, taken: usize) {
        let rate = rate_after(self.splits);
        self.splits += 1.0;
        let total = ways.sums.last().copied().unwrap_or(0.0);
        let each = if total > 0.0 { -rate / total } else { 0.0 };
        for (w, Listed { own, weight, .. }) in ways.ways.iter().enumerate() {
            let step = weight * each + if taken == w { rate } else { 0.0 };
            // What was next to impossible anyway stays as it is.
            if step > -0.01 * rate && taken != w {
                continue;
            }
            let growth = growth(step);
            for (entries, &at) in [&mut self.angle[..], &mut self.offset, &mut self.chord].into_iter().zip(own) {
                let entry = &mut entries[usize::from(at)];
                *entry = bounded(*entry * growth);
            }
        }
    }
}
