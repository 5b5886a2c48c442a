//! Section 6.8, and 7.4 to 7.6: the place of a new vertex.

use super::floats::{V64, add, cross, dot, exp, ln, mean_of, scale, squash, sub, sum64, unit64};
use super::level::{Known, Levels};
use super::mixer::{Calibration, Mixer, Odds, chance_of_no};
use super::predict::{Filter, Prediction, Width};
use super::range::Range;
use super::surface::{next, previous, vertex};
use super::{Mesh, NONE};

/// The models of 7.1.
pub struct Places {
    calibration: Calibration,
    guesses_on: bool,
    passed: u32,
    pub normal_filter: Filter,
    pub plane_filter: Filter,
    pub normal_width: Width,
    pub plane_width: Width,
    hits: Mixer,
    off: Vec<[Odds; 2]>,
    /// `E` of 6.3.
    pub mean_edge: f64,
}

impl Default for Places {
    fn default() -> Self {
        Self {
            calibration: Calibration::default(),
            guesses_on: false,
            passed: 0,
            normal_filter: Filter::new(vec![0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.3], 0.02),
            plane_filter: Filter::new(vec![0.0, 0.0, -0.1, 0.0, 0.0, 0.0], 0.05),
            normal_width: Width::new(12, 0.0),
            plane_width: Width::new(14, 0.5),
            hits: Mixer::new(&[160, 192, 120, 256], 1, 0.35, 0.3),
            off: vec![[Odds::default(); 2]; 24],
            mean_edge: 0.0,
        }
    }
}

/// The ring of the new vertex, and what 6.8 and 7.3 want of it.
pub struct Around<'a> {
    pub r: Vec<V64>,
    pub closed: bool,
    pub onto: usize,
    pub beyond: Vec<Option<V64>>,
    pub known: Vec<&'a Known>,
}

impl Levels {
    /// 6.8.
    pub fn place(&mut self, mesh: &mut Mesh, range: &mut Range, p: usize, v: usize, shared: Option<usize>) -> Result<(), String> {
        let fan = self.surface.around(mesh, self.surface.corner_of[v]);
        let m = fan.ring.len();
        let onto = fan.ring.iter().position(|r| *r == p).ok_or("6.8: a new vertex that is no neighbour of the old one")?;
        let beyond = fan.corners.iter().map(|&c| {
            let across = self.surface.across[next(c)];
            if across == NONE {
                return None;
            }
            let x = vertex(mesh, previous(across));
            if x == v { None } else { Some(mesh.place(x)) }
        });
        let beyond = beyond.collect();
        let r: Vec<V64> = fan.ring.iter().map(|&r| mesh.place(r)).collect();
        let (place, miss, hit) = match shared {
            Some(w) => {
                mesh.seam(v, mesh.first[w]);
                ([0, 1, 2].map(|k| mesh.value(w, k)), self.known[w].miss, self.known[w].exact)
            }
            None => {
                let known = fan.ring.iter().map(|&r| &self.known[r]).collect();
                let around = Around { r: r.clone(), closed: fan.closed, onto, beyond, known };
                let (place, misses, hit) = self.places.decode(range, &around);
                (place, misses.map(|x| x as f32), hit)
            }
        };
        mesh.rows[v][..3].copy_from_slice(&place);
        for k in 3..mesh.width {
            let sum: i64 = fan.ring.iter().map(|&r| i64::from(mesh.value(r, k))).sum();
            let predicted = (2 * sum + m as i64).div_euclid(2 * m as i64) as i32;
            mesh.rows[v][k] = predicted.wrapping_add(range.signed(&mut self.attribute[k - 3]));
        }
        for &r in &fan.ring {
            for j in 0..2 {
                self.known[r].miss[j] = 0.75 * self.known[r].miss[j] + 0.25 * miss[j];
            }
        }
        let middle = mean_of(&r);
        let mut s = [0.0; 3];
        for i in 0..if fan.closed { m } else { m - 1 } {
            s = add(s, cross(sub(r[i], middle), sub(r[(i + 1) % m], middle)));
        }
        self.known[v] = Known {
            position: mesh.position(v),
            edge: self.known[p].edge,
            normal: unit64(s, [0.0; 3]).map(|x| x as f32),
            valence: self.known[v].valence,
            birth: self.level,
            asked: 0,
            exact: hit,
            next: self.known[p].next,
            miss,
        };
        self.known[p].next = v;
        Ok(())
    }
}

/// A guess (7.4).
struct Guess {
    g: [i64; 3],
    most: usize,
    kept: usize,
}

impl Places {
    /// 6.3, steps 2 and 3.
    pub fn begin_level(&mut self, guesses_on: bool) {
        self.guesses_on = guesses_on;
        self.normal_filter.loosen();
        self.plane_filter.loosen();
    }

    /// The place, the misses, and whether a guess hit.
    fn decode(&mut self, range: &mut Range, a: &Around) -> ([i32; 3], [f64; 2], bool) {
        let x = self.predict(a);
        let mut place = None;
        if x.volume > 1.0 {
            self.passed = (self.passed + 1) % 16;
            if self.guesses_on || self.passed == 0 {
                let reach = [0, 1, 2].map(|i| 3.0 * x.cov(i, i).sqrt() + 2.0);
                if let Some(guess) = sought(a, x.at, reach) {
                    place = self.asked(range, &x, &guess, reach);
                }
            }
        }
        let hit = place.is_some();
        let place = place.unwrap_or_else(|| self.integers(range, &x));
        let misses = self.learn(&x, place);
        (place, misses, hit)
    }

    fn asked(&mut self, range: &mut Range, x: &Prediction, guess: &Guess, reach: V64) -> Option<[i32; 3]> {
        let distance = sum64((0..3).map(|k| (guess.g[k] as f64 - x.at[k]).abs() / reach[k]));
        let opinion = ln((3.0 / x.volume).min(1e3) as f32);
        let votes = guess.most.min(15);
        let share = (12 * guess.most / guess.kept).min(11);
        let far = ((4.0 * distance) as i32).min(11) as usize;
        let size = (2.0 * f64::from(ln(x.volume.clamp(1e-3, 1e9) as f32)) + 2.0).clamp(0.0, 15.0) as usize;
        let e = x.near.min(9);
        let at = [votes * 10 + e, votes * 12 + share, e * 12 + far, size * 16 + votes];
        if !self.hits.mixed(range, 0, &at, opinion) {
            return None;
        }
        Some([0, 1, 2].map(|k| {
            let o = &mut self.off[(votes / 2).min(7) * 3 + k];
            let g = guess.g[k];
            let there = if !o[0].ask(range) {
                g
            } else if o[1].ask(range) {
                g.wrapping_add(1)
            } else {
                g.wrapping_sub(1)
            };
            there as i32
        }))
    }

    /// 7.5.
    fn integers(&mut self, range: &mut Range, x: &Prediction) -> [i32; 3] {
        let [a, b, c] = x.order;
        let mean_0 = x.at[a];
        let z_0 = self.integer(range, 0, mean_0, x.saa);
        let off_0 = z_0 as f64 - mean_0;
        let mean_1 = x.at[b] + x.sab / x.saa * off_0;
        let z_1 = self.integer(range, 1, mean_1, x.var_b);
        let off_1 = z_1 as f64 - mean_1;
        let mean_2 = x.at[c] + (x.sac / x.saa * off_0 + x.sx / x.var_b * off_1);
        let z_2 = self.integer(range, 2, mean_2, x.var_c);
        let mut place = [0; 3];
        [place[a], place[b], place[c]] = [z_0 as i32, z_1 as i32, z_2 as i32];
        place
    }

    fn integer(&mut self, range: &mut Range, j: usize, mean: f64, variance: f64) -> i64 {
        let far = (1u64 << 34) as f64;
        let mean = if mean.is_finite() { mean.clamp(-far, far) } else { 0.0 };
        let s = 0.509 * variance.sqrt();
        let mid = (mean + 0.5).floor();
        let whole = mid as i64;
        let inv = (1.0 / s) as f32;
        let mut d = (mid - mean) as f32;
        let above = squash(-(0.5 + d) * inv);
        let below = squash((d - 0.5) * inv);
        let set = (j * 4 + [0.3, 1.0, 4.0].iter().filter(|&&x| x <= s).count()) * 3;
        if !self.calibration.calibrated(range, set, above + below) {
            return whole;
        }
        let up = range.choose(chance_of_no(above / (above + below)));
        if !up {
            d = -d;
        }
        let passes = |k: u64, w: u64| {
            let z = (k as f32 - 0.5 + d) * inv;
            let z = if z < 40.0 { z } else { 40.0 };
            (1.0 + exp(z)) / (1.0 + exp(z + w as f32 * inv))
        };
        let mut w = (s.min(1e9) as u64).max(1);
        let mut from = 1;
        while w < 1 << 35 {
            if !self.calibration.calibrated(range, set + if from == 1 { 1 } else { 2 }, passes(from, w)) {
                break;
            }
            from += w;
            w *= 2;
        }
        while w > 1 {
            let h = w / 2;
            let (all, first) = (1.0 - passes(from, w), 1.0 - passes(from, h));
            if range.choose(chance_of_no(if all > 1e-6 { 1.0 - first / all } else { 0.5 })) {
                from += h;
                w -= h;
            } else {
                w = h;
            }
        }
        if up { whole.wrapping_add(from as i64) } else { whole.wrapping_sub(from as i64) }
    }

    /// 7.6; gives the misses.
    fn learn(&mut self, x: &Prediction, place: [i32; 3]) -> [f64; 2] {
        let o = sub(place.map(f64::from), x.at);
        let off = [dot(o, x.normal), dot(o, x.t1), dot(o, x.t2)];
        let rel = off.map(|y| (y / x.radius).clamp(-1.0, 1.0));
        let factor = |i: usize, usual: f64| {
            let b = ((x.width[i] + 0.3) / x.radius).clamp(1e-3, 1.0) / usual;
            b * b
        };
        self.normal_filter.learn(&x.xn, rel[0], factor(0, 0.07));
        self.plane_filter.learn(&x.x1, rel[1], factor(1, 0.14));
        self.plane_filter.learn(&x.x2, rel[2], factor(2, 0.14));
        self.normal_width.learn(&x.xs, off[0].abs() / x.width[0]);
        self.plane_width.learn(&x.xs1, off[1].abs() / x.width[1]);
        self.plane_width.learn(&x.xs2, off[2].abs() / x.width[2]);
        [rel[0].abs(), 0.5 * (rel[1].abs() + rel[2].abs())]
    }
}

fn sought(a: &Around, at: V64, reach: V64) -> Option<Guess> {
    let (r, m) = (&a.r, a.r.len());
    if !(3..=9).contains(&m) {
        return None;
    }
    let mut candidates = Vec::new();
    for i in 0..m {
        for j in i + 1..m {
            candidates.push(scale(add(r[i], r[j]), 0.5));
        }
        candidates.push(sub(add(r[i], r[(i + 2) % m]), r[(i + 1) % m]));
        if let Some(beyond) = a.beyond.get(i).copied().flatten() {
            candidates.push(sub(add(r[i], r[(i + 1) % m]), beyond));
        }
    }
    candidates.retain(|c| (0..3).all(|k| (c[k] - at[k]).abs() <= reach[k]));
    let close = |a: &V64, b: &V64| (0..3).all(|k| (a[k] - b[k]).abs() <= 1.0);
    // Each is close to itself: its first vote.
    let votes: Vec<usize> = candidates.iter().map(|c| candidates.iter().filter(|o| close(c, o)).count()).collect();
    let most = votes.iter().max().copied()?;
    let mut best: Option<(f64, V64)> = None;
    for (c, _) in candidates.iter().zip(&votes).filter(|(_, votes)| **votes == most) {
        let distance = sum64((0..3).map(|k| (c[k] - at[k]).abs() / reach[k]));
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, *c));
        }
    }
    best.map(|(_, c)| Guess { g: c.map(|x| (x + 0.5).floor() as i64), most, kept: candidates.len() })
}
