//! Where a new vertex stands: predicted from its ring by filters that learn, and coded against a distribution that learns how
//! far off they are along the normal and in the tangent plane.

use super::exact::ExactModel;
use super::filter::Filter;
use super::float::{exp, fit, ln, log2};
use super::number::{Calibration, Counter, LEAST_VARIANCE, Smooth};
use super::vector::{Vector, add, cross, dot, scale, sub};
use crate::range::Coder;

pub(super) type P = Vector<f64>;

/// `a` to length 1, or `other` where it has none.
pub(super) fn unit(a: P, other: P) -> P {
    let l = dot(a, a).sqrt();
    if l > 1e-9 { scale(a, 1.0 / l) } else { other }
}
/// ln x, to 0.003.
fn log(x: f64) -> f64 {
    f64::from(log2(fit(x, 1e-30, 1e30) as f32) * std::f32::consts::LN_2)
}

/// What is known around a new vertex. The representative is the first of the ring, or the last of an open one whose side is
/// the head.
#[derive(Clone, Debug, Default)]
pub(super) struct Star {
    pub(super) ring: Vec<P>,
    pub(super) closed: bool,
    /// Place of the representative in the ring.
    pub(super) onto: usize,
    /// Vertex beyond each ring edge, from each ring vertex to the next.
    pub(super) beyond: Vec<Option<P>>,
    /// Neighbours of each ring vertex.
    pub(super) valences: Vec<f64>,
    /// Normals of the ring's vertices.
    pub(super) normals: Vec<P>,
    /// How far off predictions were there, in the mean: along the normal, in the plane; parts of the ring's size.
    pub(super) misses: [f64; 2],
    /// How many of the ring stand where a regular neighbourhood has them.
    pub(super) exact: usize,
}

impl Star {
    /// The mean normal of the ring's triangles about its middle, or nothing.
    pub(super) fn normal(&self) -> P {
        let k = self.ring.len();
        let middle = scale(self.ring.iter().fold([0.0; 3], |s, &r| add(s, r)), 1.0 / k as f64);
        let edges = if self.closed { k } else { k - 1 };
        let sum = (0..edges).fold([0.0; 3], |s, i| {
            let j = if i + 1 == k { 0 } else { i + 1 };
            add(s, cross(sub(self.ring[i], middle), sub(self.ring[j], middle)))
        });
        unit(sum, [0.0; 3])
    }
}

const NORMAL: usize = 7;
const PLANE: usize = 6;
const SIZES: usize = 12;

/// How far off predictions are: a Laplace distribution's width, its logarithm linear in what is known.
#[derive(Clone, Debug)]
struct Width<const N: usize> {
    weights: [f64; N],
    seen: f64,
}

impl<const N: usize> Width<N> {
    fn new(first: f64) -> Self {
        let mut weights = [0.0; N];
        (weights[0], weights[1]) = (first, 1.0);
        Self { weights, seen: 0.0 }
    }
    fn of(&self, x: &[f64; N]) -> f64 {
        let sum: f64 = self.weights.iter().zip(x).map(|(w, x)| w * x).sum();
        f64::from(exp(fit(sum, -6.0, 40.0) as f32))
    }
    fn learn(&mut self, x: &[f64; N], ratio: f64) {
        let rate = 0.002 * (1.0 + 20.0 / (1.0 + self.seen / 20.0));
        let step = rate * (ratio.min(6.0) - 1.0);
        self.weights.iter_mut().zip(x).for_each(|(w, x)| *w += step * x);
        self.seen += 1.0;
    }
}

/// All that is learnt about places.
#[derive(Clone, Debug)]
pub(super) struct PlaceModel {
    calibration: Calibration,
    exact: ExactModel,
    /// Scratch: the ring about its middle.
    ring: Vec<P>,
    normal: Filter<NORMAL>,
    plane: Filter<PLANE>,
    normal_width: Width<SIZES>,
    plane_width: Width<{ SIZES + 2 }>,
}

impl PlaceModel {
    pub(super) fn new() -> Self {
        let mut normal = [0.0; NORMAL];
        (normal[2], normal[6]) = (-0.1, 0.3);
        let mut plane = [0.0; PLANE];
        plane[2] = -0.1;
        Self {
            calibration: Calibration::new(),
            exact: ExactModel::new(),
            ring: Vec::new(),
            normal: Filter::new(normal, 0.02),
            plane: Filter::new(plane, 0.05),
            normal_width: Width::new(0.0),
            plane_width: Width::new(0.5),
        }
    }
    /// Bytes of the tables.
    pub(super) fn memory_bytes(&self) -> usize {
        self.calibration.memory_bytes() + self.exact.memory_bytes()
    }
    pub(super) fn begin_level(&mut self, coder: &mut impl Coder) {
        self.exact.begin_level(coder);
        self.normal.loosen();
        self.plane.loosen();
    }

    /// Codes a place; gives it and how far off the prediction was: along the normal, in the plane.
    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        star: &Star,
        mean_edge: f64,
        truth: Option<[i32; 3]>,
    ) -> ([i32; 3], [f64; 2], bool) {
        let k = star.ring.len();
        let count = k as f64;
        let middle = scale(star.ring.iter().fold([0.0; 3], |s, &r| add(s, r)), 1.0 / count);
        let closing = &mut self.ring;
        closing.clear();
        closing.extend(star.ring.iter().map(|&r| sub(r, middle)));
        if star.closed {
            closing.push(closing[0]);
        }
        // With the first once more at the end of a closed one: pairs are edges.
        let closing = &self.ring[..];
        let ring = &closing[..k];
        let radius = (ring.iter().map(|&r| dot(r, r).sqrt()).sum::<f64>() / count).max(0.25);
        let sum = closing.windows(2).fold([0.0; 3], |s, e| add(s, cross(e[0], e[1])));
        let normal_sum = star.normals.iter().fold([0.0; 3], |s, &n| add(s, n));
        let normal = unit(sum, unit(normal_sum, [0.0, 0.0, 1.0]));
        let (t1, t2, spread) = axes(ring, normal);
        // Features, relative to the middle.
        let p = ring[star.onto];
        let cut = match (star.closed, star.onto) {
            (true, 0) => scale(add(ring[1], ring[k - 1]), 0.5),
            (true, i) => scale(add(closing[i + 1], ring[i - 1]), 0.5),
            (false, 0) => ring[1],
            (false, i) => ring[i - 1],
        };
        let (mut outer, mut parallelograms, mut beyond) = ([0.0; 3], [0.0; 3], 0.0);
        let (mut weighted, mut weights) = ([0.0; 3], 0.0);
        for (ends, o) in closing.windows(2).zip(&star.beyond) {
            let both = add(ends[0], ends[1]);
            if let Some(o) = o {
                let o = sub(*o, middle);
                outer = add(outer, o);
                parallelograms = add(parallelograms, sub(both, o));
                beyond += 1.0;
            }
            let edge = sub(ends[1], ends[0]);
            let l = dot(edge, edge).sqrt();
            weighted = add(weighted, scale(both, 0.5 * l));
            weights += l;
        }
        if beyond > 0.0 {
            outer = scale(outer, 1.0 / beyond);
            parallelograms = scale(parallelograms, 1.0 / beyond);
        }
        if weights > 0.0 {
            weighted = scale(weighted, 1.0 / weights);
        }
        let mut uneven = [0.0; 3];
        let mut curvature = 0.0;
        for ((&r, valence), &normal) in ring.iter().zip(&star.valences).zip(&star.normals) {
            uneven = add(uneven, scale(r, valence - 6.0));
            curvature += dot(normal, r);
        }
        uneven = scale(uneven, 1.0 / count);
        curvature /= count;
        let features = [p, cut, outer, weighted, parallelograms, uneven].map(|f| scale(f, 1.0 / radius));
        let along = |axis: P| features.map(|f| dot(f, axis));
        let (n6, x1, x2) = (along(normal), along(t1), along(t2));
        let xn: [f64; NORMAL] = std::array::from_fn(|i| if i < 6 { n6[i] } else { curvature / radius });
        let guess = [self.normal.predict(&xn), self.plane.predict(&x1), self.plane.predict(&x2)].map(|g| g.clamp(-2.0, 2.0));
        // How sure.
        let misses = star.misses;
        let mean_normal = unit(normal_sum, normal);
        let bend = star.normals.iter().map(|&n| 1.0 - dot(n, mean_normal)).sum::<f64>() / count;
        let size = |f: P| dot(f, f).sqrt();
        let odd = count - 6.0;
        let xs: [f64; SIZES] = [
            1.0,
            log(radius) - 3.0,
            log(misses[0] + 0.001) + 3.0,
            log(bend + 1e-4) + 4.0,
            0.3 * odd,
            log(misses[1] + 0.001) + 2.0,
            log(size(features[3]) + 0.02) + 2.0,
            log(size(features[2]) + 0.02) + 2.0,
            0.5 * odd.abs(),
            log(guess[0].abs() + 0.01) + 3.0,
            log(size(features[0]) + 0.05),
            log(radius / mean_edge.max(0.1) + 0.01),
        ];
        let p_unit = unit(p, [0.0; 3]);
        let plane = |axis: P, spread: f64| -> [f64; SIZES + 2] {
            let c = dot(p_unit, axis);
            std::array::from_fn(|i| match i {
                i if i < SIZES => xs[i],
                SIZES => log(spread / radius + 0.05),
                _ => c * c - 0.5,
            })
        };
        let (xs1, xs2) = (plane(t1, spread[0]), plane(t2, spread[1]));
        let widths =
            [self.normal_width.of(&xs), self.plane_width.of(&xs1), self.plane_width.of(&xs2)].map(|b| b.min(8.0 * radius));
        let mut at = middle;
        for (axis, g) in [(normal, guess[0]), (t1, guess[1]), (t2, guess[2])] {
            at = add(at, scale(axis, g * radius));
        }
        // Covariance of what is off, in the axes of the grid.
        let variance = widths.map(|b| 2.0 * b * b + LEAST_VARIANCE);
        let covariance =
            |i: usize, j: usize| [(normal, 0), (t1, 1), (t2, 2)].iter().map(|(a, k)| a[i] * a[j] * variance[*k]).sum::<f64>();
        // The axis that the normal is least along goes first: what comes later profits most.
        let mut order = [0usize, 1, 2];
        order.sort_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()).then(a.cmp(&b)));
        let [a, b, c] = order;
        let (saa, sab, sac) = (covariance(a, a), covariance(a, b), covariance(a, c));
        let (sbb, sbc, scc) = (covariance(b, b), covariance(b, c), covariance(c, c));
        let mut hit = None;
        let var_b = (sbb - sab * sab / saa).max(LEAST_VARIANCE);
        let cross_bc = sbc - sab * sac / saa;
        let var_c = (scc - sac * sac / saa - cross_bc * cross_bc / var_b).max(LEAST_VARIANCE);
        let smooth = Smooth {
            order,
            means: order.map(|i| at[i]),
            slopes: [sab / saa, sac / saa, cross_bc / var_b],
            variances: [saa, var_b, var_c],
        };
        // About how many grid points are likely.
        let volume = (saa * var_b * var_c).sqrt();
        if self.exact.is_worth(volume) {
            let reach: P = [0, 1, 2].map(|i| 3.0 * covariance(i, i).sqrt() + 2.0);
            if let Some(guess) = self.exact.guess(star, at, reach) {
                let distance = (0..3).map(|i| (guess.place[i] as f64 - at[i]).abs() / reach[i]).sum::<f64>();
                let opinion = ln((3.0 / volume).min(1e3) as f32);
                let before = coder.position();
                hit = self.exact.code(coder, &guess, (star.exact, volume, distance), opinion, truth);
                if C::ENCODES {
                    let mut count = Counter::default();
                    if hit.is_some() {
                        smooth.code(&mut count, &mut self.calibration, truth);
                    }
                    self.exact.saved += count.bits - (coder.position() - before);
                }
            }
        }
        let out = match hit {
            Some(place) => place.map(|x| x as i32),
            None => smooth.code(coder, &mut self.calibration, truth),
        };
        // Learn.
        let off = sub(out.map(f64::from), at);
        let off = [dot(off, normal), dot(off, t1), dot(off, t2)];
        let relative = off.map(|o| (o / radius).clamp(-1.0, 1.0));
        let noise = |i: usize, usual: f64| {
            let b = ((widths[i] + 0.3) / radius).clamp(1e-3, 1.0) / usual;
            b * b
        };
        let (c1, c2): (f64, f64) = (0.07, 0.14);
        self.normal.learn(&xn, relative[0], noise(0, c1));
        self.plane.learn(&x1, relative[1], noise(1, c2));
        self.plane.learn(&x2, relative[2], noise(2, c2));
        self.normal_width.learn(&xs, off[0].abs() / widths[0]);
        self.plane_width.learn(&xs1, off[1].abs() / widths[1]);
        self.plane_width.learn(&xs2, off[2].abs() / widths[2]);
        (out, [relative[0].abs(), 0.5 * (relative[1].abs() + relative[2].abs())], hit.is_some())
    }
}

/// Principal axes of a ring in the plane of `normal`, the longer first; and the ring's root mean square along each.
fn axes(ring: &[P], normal: P) -> (P, P, [f64; 2]) {
    let [x, y, z] = normal.map(f64::abs);
    let other = if x <= y && x <= z {
        [1.0, 0.0, 0.0]
    } else if y <= z {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let u = unit(cross(normal, other), [1.0, 0.0, 0.0]);
    let w = cross(normal, u);
    let (mut uu, mut uw, mut ww) = (0.0, 0.0, 0.0);
    for &r in ring {
        let (a, b) = (dot(r, u), dot(r, w));
        uu += a * a;
        uw += a * b;
        ww += b * b;
    }
    let half = 0.5 * (uu - ww);
    let root = (half * half + uw * uw).sqrt();
    let (large, small) = (0.5 * (uu + ww) + root, (0.5 * (uu + ww) - root).max(0.0));
    let (c, s) = if half > 0.0 { (half + root, uw) } else { (uw, root - half) };
    let l = (c * c + s * s).sqrt();
    let (c, s) = if l > 1e-9 { (c / l, s / l) } else { (1.0, 0.0) };
    let t1 = add(scale(u, c), scale(w, s));
    let n = ring.len() as f64;
    (t1, cross(normal, t1), [(large / n).sqrt(), (small / n).sqrt()])
}
