//! Section 6.5, `learn`.

use super::choose::rate;
use super::floats::{growth, smaller, sum32};
use super::ways::{Gathered, Side, Tables, Way, Weighed, bounded, times};

impl Tables {
    pub fn learn(&mut self, g: &Gathered, w: &Weighed, way: Option<&Way>) {
        if way.is_none() && w.chance < 0.2 {
            return;
        }
        let n = g.n;
        let r = rate(self.seen);
        self.seen += 1.0;
        self.lessons += 1;
        if self.lessons.is_multiple_of(256) {
            for x in self.roles.iter_mut().flatten() {
                *x = x.map(|x| bounded(x, 1000.0));
            }
        }
        let mut step = vec![[0.0; 4]; 2 * n + 2];
        let mut arc_step = vec![vec![0.0; n]; 4];
        self.steps(g, w, r, &mut step, &mut arc_step);
        if let Some(way) = way {
            let (left, right, f, e) = match way.side {
                Side::Inside => (r, r, way.from + 1, way.to),
                Side::Head => (0.0, r, 0, way.to),
                Side::Tail => (r, 0.0, way.from + 1, n),
            };
            arc_step[way.kind(g.closed)][way.to - way.from] += r;
            step[way.from][0] += left;
            step[way.to][1] += right;
            step[f][2] += r;
            step[e][2] -= r;
        }
        let mut sum = 0.0;
        for i in 0..2 * n {
            sum += step[i][2];
            step[i][2] = sum;
        }
        if g.closed {
            for i in 0..n {
                for j in 0..3 {
                    step[i][j] += step[i + n][j];
                }
            }
        }
        let ag = 0.5 * r * (if way.is_none() { 1.0 } else { 0.0 } - (1.0 - w.chance));
        for i in 0..n {
            let grown = [growth(step[i][0]), growth(step[i][1]), growth(step[i][2]), growth(0.5 * ag)];
            for j in 0..4 {
                let entry = &mut self.roles[j][w.at[i][j]];
                *entry = times(*entry, grown);
            }
        }
        let kinds: &[usize] = if g.closed { &[0] } else { &[1, 2, 3] };
        for &kind in kinds {
            for m in 0..n {
                let entry = &mut self.arc[kind][n][m];
                *entry = bounded(*entry * growth(arc_step[kind][m]), 1000.0);
            }
            let entry = &mut self.seam[g.seam][kind];
            *entry = bounded(*entry * growth(sum32(arc_step[kind].iter().copied())), 1000.0);
        }
        for i in 0..6 {
            let entry = &mut self.no[i][w.no_at[i]];
            *entry = bounded(*entry * growth(ag), 1000.0);
        }
    }

    /// What all ways together take away.
    fn steps(&self, g: &Gathered, w: &Weighed, r: f32, step: &mut [[f32; 4]], arc_step: &mut [Vec<f32>]) {
        let (n, k, factor) = (g.n, w.k, &w.factor);
        let each = if w.total > 0.0 { -r * w.chance / w.total } else { 0.0 };
        let s = self.seam[g.seam].map(|x| x * each);
        for from in (g.first_from..n).filter(|&from| w.free[from]) {
            let (mut inner, mut sum) = (factor[from][0], 0.0);
            for to in from + 1..if g.closed { from + n } else { n } {
                let weight = inner * factor[to][1] * (self.arc[k][n][to - from] * s[k]);
                inner = smaller(inner * factor[to][2], 1e12);
                sum += weight;
                arc_step[k][to - from] += weight;
                step[to][1] += weight;
                step[to][2] -= weight;
            }
            step[from][0] += sum;
            step[from + 1][2] += sum;
        }
        if g.closed {
            return;
        }
        if g.first_from == 0 {
            let (mut inner, mut sum) = (1.0, 0.0);
            for i in 0..n {
                let weight = inner * factor[i][1] * (self.arc[2][n][i] * s[2]);
                inner = smaller(inner * factor[i][2], 1e12);
                sum += weight;
                arc_step[2][i] += weight;
                step[i][1] += weight;
                step[i][2] -= weight;
            }
            step[0][2] += sum;
        }
        let mut inner = 1.0;
        for from in (g.first_from..n).rev() {
            let weight = inner * factor[from][0] * (self.arc[3][n][n - 1 - from] * s[3]);
            inner = smaller(inner * factor[from][2], 1e12);
            arc_step[3][n - 1 - from] += weight;
            step[from][0] += weight;
            step[from + 1][2] += weight;
            step[n][2] -= weight;
        }
    }
}
