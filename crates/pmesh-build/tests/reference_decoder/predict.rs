//! Sections 7.2 and 7.3: filters, widths, and where a new vertex is expected.

use super::floats::{V64, add, cross, dot, exp, fit, log, mean_of, scale, sub, sum64, unit64};
use super::place::{Around, Places};

pub struct Filter {
    w: Vec<f64>,
    p: Vec<Vec<f64>>,
    noise: f64,
}

impl Filter {
    pub fn new(w: Vec<f64>, noise: f64) -> Self {
        let mut p = vec![vec![0.0; w.len()]; w.len()];
        (0..w.len()).for_each(|i| p[i][i] = 3.0);
        Self { w, p, noise }
    }
    pub fn loosen(&mut self) {
        (0..self.w.len()).for_each(|i| self.p[i][i] += 0.003);
    }
    fn predict(&self, x: &[f64]) -> f64 {
        sum64((0..x.len()).map(|i| self.w[i] * x[i]))
    }
    pub fn learn(&mut self, x: &[f64], error: f64, factor: f64) {
        let n = x.len();
        let px: Vec<f64> = (0..n).map(|i| sum64((0..n).map(|j| self.p[i][j] * x[j]))).collect();
        let total = self.noise * factor + sum64((0..n).map(|i| px[i] * x[i]));
        for i in 0..n {
            let g = px[i] / total;
            self.w[i] += g * error;
            for j in 0..=i {
                self.p[i][j] = (self.p[i][j] - g * px[j]) * (1.0 / (1.0 - 1.0 / 950.0));
                self.p[j][i] = self.p[i][j];
            }
        }
        for i in 0..n {
            if self.p[i][i] > 3.0 {
                let s = (3.0 / self.p[i][i]).sqrt();
                for j in 0..n {
                    self.p[i][j] *= s;
                    self.p[j][i] *= s;
                }
            }
        }
    }
}

pub struct Width {
    w: Vec<f64>,
    seen: f64,
}

impl Width {
    pub fn new(features: usize, first: f64) -> Self {
        let mut w = vec![0.0; features];
        [w[0], w[1]] = [first, 1.0];
        Self { w, seen: 0.0 }
    }
    fn of(&self, x: &[f64]) -> f64 {
        f64::from(exp(fit(sum64((0..x.len()).map(|i| self.w[i] * x[i])), -6.0, 40.0) as f32))
    }
    pub fn learn(&mut self, x: &[f64], ratio: f64) {
        let rate = 0.002 * (1.0 + 20.0 / (1.0 + self.seen / 20.0));
        let step = rate * (ratio.min(6.0) - 1.0);
        for i in 0..x.len() {
            self.w[i] += step * x[i];
        }
        self.seen += 1.0;
    }
}

/// What 7.3 computes and 7.4 to 7.6 use.
pub struct Prediction {
    pub near: usize,
    pub radius: f64,
    pub normal: V64,
    pub t1: V64,
    pub t2: V64,
    pub xn: Vec<f64>,
    pub x1: Vec<f64>,
    pub x2: Vec<f64>,
    pub xs: Vec<f64>,
    pub xs1: Vec<f64>,
    pub xs2: Vec<f64>,
    pub width: V64,
    pub at: V64,
    var: V64,
    pub order: [usize; 3],
    pub saa: f64,
    pub sab: f64,
    pub sac: f64,
    pub sx: f64,
    pub var_b: f64,
    pub var_c: f64,
    pub volume: f64,
}

impl Prediction {
    pub fn cov(&self, i: usize, j: usize) -> f64 {
        let Self { normal, t1, t2, var, .. } = self;
        normal[i] * normal[j] * var[0] + t1[i] * t1[j] * var[1] + t2[i] * t2[j] * var[2]
    }
}

impl Places {
    pub fn predict(&self, a: &Around) -> Prediction {
        let (r, m, closed, onto) = (&a.r, a.r.len(), a.closed, a.onto);
        let count = m as f64;
        let near = a.known.iter().filter(|k| k.exact).count();
        let share = 1.0 / count;
        let mut misses = [0.0; 2];
        for i in 0..m {
            for j in 0..2 {
                misses[j] += share * f64::from(a.known[i].miss[j]);
            }
        }
        let middle = mean_of(r);
        let mut q: Vec<V64> = r.iter().map(|&r| sub(r, middle)).collect();
        if closed {
            q.push(q[0]);
        }
        let pairs = q.len() - 1;
        let radius = (sum64((0..m).map(|i| dot(q[i], q[i]).sqrt())) / count).max(0.25);
        let mut s = [0.0; 3];
        for i in 0..pairs {
            s = add(s, cross(q[i], q[i + 1]));
        }
        let normal_of = |i: usize| a.known[i].normal.map(f64::from);
        let mut ns = [0.0; 3];
        for i in 0..m {
            ns = add(ns, normal_of(i));
        }
        let normal = unit64(s, unit64(ns, [0.0, 0.0, 1.0]));
        let (t1, t2, spread) = axes(&q[..m], normal);
        let p = q[onto];
        let cut = match (closed, onto) {
            (true, 0) => scale(add(q[1], q[m - 1]), 0.5),
            (true, _) => scale(add(q[onto + 1], q[onto - 1]), 0.5),
            (false, 0) => q[1],
            (false, _) => q[onto - 1],
        };
        let (mut outer, mut par, mut weighted) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let (mut beyonds, mut weights) = (0.0, 0.0);
        for i in 0..pairs {
            let both = add(q[i], q[i + 1]);
            if let Some(beyond) = a.beyond[i] {
                let o = sub(beyond, middle);
                outer = add(outer, o);
                par = add(par, sub(both, o));
                beyonds += 1.0;
            }
            let e = sub(q[i + 1], q[i]);
            let l = dot(e, e).sqrt();
            weighted = add(weighted, scale(both, 0.5 * l));
            weights += l;
        }
        if beyonds > 0.0 {
            outer = scale(outer, 1.0 / beyonds);
            par = scale(par, 1.0 / beyonds);
        }
        if weights > 0.0 {
            weighted = scale(weighted, 1.0 / weights);
        }
        let (mut uneven, mut curvature) = ([0.0; 3], 0.0);
        for i in 0..m {
            uneven = add(uneven, scale(q[i], f64::from(a.known[i].valence) - 6.0));
            curvature += dot(normal_of(i), q[i]);
        }
        uneven = scale(uneven, 1.0 / count);
        curvature /= count;
        let f = [p, cut, outer, weighted, par, uneven].map(|x| scale(x, 1.0 / radius));
        let along = |axis: V64| -> Vec<f64> { f.iter().map(|&f| dot(f, axis)).collect() };
        let (mut xn, x1, x2) = (along(normal), along(t1), along(t2));
        xn.push(curvature / radius);
        let guess = [self.normal_filter.predict(&xn), self.plane_filter.predict(&x1), self.plane_filter.predict(&x2)];
        let guess = guess.map(|x| x.clamp(-2.0, 2.0));

        // How sure that is.
        let mn = unit64(ns, normal);
        let bend = sum64((0..m).map(|i| 1.0 - dot(normal_of(i), mn))) / count;
        let odd = count - 6.0;
        let size = |a: V64| dot(a, a).sqrt();
        let xs = vec![
            1.0,
            log(radius) - 3.0,
            log(misses[0] + 0.001) + 3.0,
            log(bend + 1e-4) + 4.0,
            0.3 * odd,
            log(misses[1] + 0.001) + 2.0,
            log(size(f[3]) + 0.02) + 2.0,
            log(size(f[2]) + 0.02) + 2.0,
            0.5 * odd.abs(),
            log(guess[0].abs() + 0.01) + 3.0,
            log(size(f[0]) + 0.05),
            log(radius / self.mean_edge.max(0.1) + 0.01),
        ];
        let pu = unit64(p, [0.0; 3]);
        let with = |spread: f64, c: f64| [&xs[..], &[log(spread / radius + 0.05), c * c - 0.5]].concat();
        let (xs1, xs2) = (with(spread[0], dot(pu, t1)), with(spread[1], dot(pu, t2)));
        let width = [self.normal_width.of(&xs), self.plane_width.of(&xs1), self.plane_width.of(&xs2)];
        let width = width.map(|x| x.min(8.0 * radius));
        let mut at = middle;
        at = add(at, scale(normal, guess[0] * radius));
        at = add(at, scale(t1, guess[1] * radius));
        at = add(at, scale(t2, guess[2] * radius));
        let var = width.map(|w| 2.0 * w * w + 1.0 / 12.0);
        let mut order = [0, 1, 2];
        order.sort_by(|&i: &usize, &j| normal[i].abs().total_cmp(&normal[j].abs()));
        let mut out = Prediction {
            near,
            radius,
            normal,
            t1,
            t2,
            xn,
            x1,
            x2,
            xs,
            xs1,
            xs2,
            width,
            at,
            var,
            order,
            saa: 0.0,
            sab: 0.0,
            sac: 0.0,
            sx: 0.0,
            var_b: 0.0,
            var_c: 0.0,
            volume: 0.0,
        };
        out.spread();
        out
    }
}

impl Prediction {
    /// Variances of the axes one after another.
    fn spread(&mut self) {
        let [a, b, c] = self.order;
        let (saa, sab, sac) = (self.cov(a, a), self.cov(a, b), self.cov(a, c));
        let (sbb, sbc, scc) = (self.cov(b, b), self.cov(b, c), self.cov(c, c));
        let var_b = (sbb - sab * sab / saa).max(1.0 / 12.0);
        let sx = sbc - sab * sac / saa;
        let var_c = (scc - sac * sac / saa - sx * sx / var_b).max(1.0 / 12.0);
        self.volume = (saa * var_b * var_c).sqrt();
        (self.saa, self.sab, self.sac, self.sx, self.var_b, self.var_c) = (saa, sab, sac, sx, var_b, var_c);
    }
}

fn axes(q: &[V64], normal: V64) -> (V64, V64, [f64; 2]) {
    let count = q.len() as f64;
    let [x, y, z] = normal.map(f64::abs);
    let other = if x <= y && x <= z {
        [1.0, 0.0, 0.0]
    } else if y <= z {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let u = unit64(cross(normal, other), [1.0, 0.0, 0.0]);
    let w = cross(normal, u);
    let (mut uu, mut uw, mut ww) = (0.0, 0.0, 0.0);
    for &q in q {
        let (a, b) = (dot(q, u), dot(q, w));
        uu += a * a;
        uw += a * b;
        ww += b * b;
    }
    let half = 0.5 * (uu - ww);
    let root = (half * half + uw * uw).sqrt();
    let large = 0.5 * (uu + ww) + root;
    let small = (0.5 * (uu + ww) - root).max(0.0);
    let (c, s) = if half > 0.0 { (half + root, uw) } else { (uw, root - half) };
    let l = (c * c + s * s).sqrt();
    let (c, s) = if l > 1e-9 { (c / l, s / l) } else { (1.0, 0.0) };
    let t1 = add(scale(u, c), scale(w, s));
    let t2 = cross(normal, t1);
    (t1, t2, [(large / count).sqrt(), (small / count).sqrt()])
}
