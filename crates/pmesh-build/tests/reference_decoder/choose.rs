//! Section 6.5, `choose`.

use super::floats::{add, arccos, class, dot, growth, larger, ln, octaves, smaller, sub, sum32};
use super::mixer::chance_of_no;
use super::range::Range;
use super::ways::{Gathered, Side, Tables, Way, Weighed, bounded};

pub fn rate(s: f32) -> f32 {
    0.012 * (1.0 + 8.0 / (1.0 + s / 400.0))
}

struct Listed {
    way: Way,
    ca: usize,
    co: usize,
    cc: usize,
    weight: f32,
}

impl Tables {
    fn listed(&self, way: Way, weight: f32, a: f32, middle: [f32; 3], chord: f32) -> Listed {
        let share = 1.0 / ((way.to - way.from) as f32 + 2.0);
        let ca = class(a, 25);
        let co = octaves(dot(middle, middle) * (share * share), 1, 5, 14);
        let cc = octaves(chord, 1, 4, 14);
        Listed { way, ca, co, cc, weight: weight * self.angle[ca] * (self.offset[co] * self.chord[cc]) }
    }

    fn list(&self, g: &Gathered, w: &Weighed) -> Vec<Listed> {
        let (n, k, factor, arm) = (g.n, w.k, &w.factor, &w.arm);
        let mut angle = Vec::new();
        let mut all = 0.0;
        for i in 0..w.triangles {
            angle.push(arccos(dot(arm[i], arm[i + 1]) / larger((w.sq[i] * w.sq[i + 1]).sqrt(), 1e-12)));
            all += angle[i];
        }
        let per = 24.0 / larger(all, 1e-6);
        angle.iter_mut().for_each(|a| *a *= per);
        let s = self.seam[g.seam].map(|x| 1e-9 * x);
        let mut list = Vec::new();
        for from in (g.first_from..n).filter(|&from| w.free[from]) {
            let (mut inner, mut a, mut middle) = (factor[from][0], 0.0, arm[from]);
            for to in from + 1..if g.closed { from + n } else { n } {
                if !w.free[to] {
                    break;
                }
                a += angle[(to - 1) % w.triangles];
                middle = add(middle, arm[to]);
                let c = sub(arm[from], arm[to]);
                let weight = inner * factor[to][1] * (self.arc[k][n][to - from] * s[k]);
                list.push(self.listed(Way { side: Side::Inside, from, to }, weight, a, middle, dot(c, c)));
                inner = smaller(inner * factor[to][2], 1e12);
            }
        }
        if g.closed {
            return list;
        }
        let (mut inner, mut a, mut middle) = (1.0, 0.0, [0.0; 3]);
        for to in 0..if g.first_from == 0 { n } else { 0 } {
            if !w.free[to] {
                break;
            }
            if to > 0 {
                a += angle[to - 1];
            }
            middle = add(middle, arm[to]);
            let weight = inner * factor[to][1] * (self.arc[2][n][to] * s[2]);
            list.push(self.listed(Way { side: Side::Head, from: 0, to }, weight, a, middle, 0.0));
            inner = smaller(inner * factor[to][2], 1e12);
        }
        let (mut inner, mut a, mut middle) = (1.0, 0.0, [0.0; 3]);
        for from in (g.first_from..n).rev() {
            if !w.free[from] {
                break;
            }
            if from + 1 < n {
                a += angle[from];
            }
            middle = add(middle, arm[from]);
            let weight = inner * factor[from][0] * (self.arc[3][n][n - 1 - from] * s[3]);
            list.push(self.listed(Way { side: Side::Tail, from, to: n - 1 }, weight, a, middle, 0.0));
            inner = smaller(inner * factor[from][2], 1e12);
        }
        list
    }

    /// The way taken, and `rest`.
    pub fn choose(&mut self, range: &mut Range, g: &Gathered, w: &Weighed) -> (Way, f32) {
        let mut list = self.list(g, w);
        // sums[i] is the sum of the first i weights here.
        let mut sums = vec![0.0];
        for i in 0..list.len() {
            sums.push(sums[i] + list[i].weight);
        }
        let (mut low, mut high) = (0, list.len());
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            let (a, h, z) = (sums[low], sums[middle], sums[high]);
            let yes = if z > a { (z - h) / (z - a) } else { 0.5 };
            if range.choose(chance_of_no(yes)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let r = rate(self.ways_seen);
        self.ways_seen += 1.0;
        let sum = sums[list.len()];
        let each = if sum > 0.0 { -r / sum } else { 0.0 };
        for (i, l) in list.iter().enumerate() {
            let step = l.weight * each + if i == low { r } else { 0.0 };
            if step > -0.01 * r && i != low {
                continue;
            }
            for entry in [&mut self.angle[l.ca], &mut self.offset[l.co], &mut self.chord[l.cc]] {
                *entry = bounded(*entry * growth(step), 1000.0);
            }
        }
        let Way { from, to, .. } = list[low].way;
        let apart = |l: &&Listed| (l.way.from >= to && l.way.to <= from + g.n) || l.way.to <= from;
        let rest_sum = sum32(list.iter().filter(apart).map(|l| l.weight));
        let rest = ln(larger(rest_sum / larger(sum, 1e-30) * w.ratio, 1e-9)).clamp(-8.0, 8.0);
        (list.swap_remove(low).way, rest)
    }
}
