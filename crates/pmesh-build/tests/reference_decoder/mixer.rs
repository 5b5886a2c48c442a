//! Section 3.3: floating-point models.

use super::floats::{squash, stretch};
use super::range::Range;

pub fn chance_of_no(yes: f32) -> u32 {
    (((1.0 - yes) * 65536.0) as i32).clamp(24, 65512) as u32
}

fn rate(seen: u32) -> f32 {
    1.0 / (seen as f32 + 1.5)
}

fn one_if(bit: bool) -> f32 {
    if bit { 1.0 } else { 0.0 }
}

#[derive(Clone, Copy)]
pub struct Odds {
    yes: f32,
    seen: u32,
    stretched: f32,
}

impl Default for Odds {
    fn default() -> Self {
        Self { yes: 0.5, seen: 0, stretched: 0.0 }
    }
}

impl Odds {
    fn learn(&mut self, bit: bool) {
        self.yes += (one_if(bit) - self.yes) * rate(self.seen);
        self.stretched = stretch(self.yes.clamp(0.001, 0.999));
        self.seen = (self.seen + 1).min(255);
    }
    pub fn ask(&mut self, range: &mut Range) -> bool {
        let bit = range.choose(chance_of_no(self.yes));
        self.learn(bit);
        bit
    }
}

pub struct Mixer {
    tables: Vec<Vec<Odds>>,
    w: Vec<Vec<f32>>,
    v: Vec<f32>,
}

impl Mixer {
    pub fn new(sizes: &[usize], sets: usize, weight: f32, opinions_weight: f32) -> Self {
        Self {
            tables: sizes.iter().map(|&size| vec![Odds::default(); size]).collect(),
            w: vec![vec![weight; sizes.len()]; sets],
            v: vec![opinions_weight; sets],
        }
    }
    pub fn mixed(&mut self, range: &mut Range, set: usize, at: &[usize], opinion: f32) -> bool {
        let mut sum = self.v[set] * opinion;
        let mut x = vec![0.0; at.len()];
        for i in 0..at.len() {
            let o = &self.tables[i][at[i]];
            x[i] = o.stretched * o.seen.min(8) as f32 * 0.125;
            sum += self.w[set][i] * x[i];
        }
        let yes = squash(sum.clamp(-9.0, 9.0));
        let bit = range.choose(chance_of_no(yes));
        let e = f32::from_bits(0x3c03_126f) * (one_if(bit) - yes);
        for i in 0..at.len() {
            self.w[set][i] += e * x[i];
            self.tables[i][at[i]].learn(bit);
        }
        self.v[set] += e * opinion;
        bit
    }
}

#[derive(Clone, Copy)]
struct Point {
    yes: f32,
    seen: u32,
}

pub struct Calibration {
    sets: Vec<Vec<Point>>,
}

impl Default for Calibration {
    fn default() -> Self {
        let points: Vec<Point> = (0..33).map(|i| Point { yes: squash(0.5 * i as f32 - 8.0), seen: 20 }).collect();
        Self { sets: vec![points; 36] }
    }
}

impl Calibration {
    pub fn calibrated(&mut self, range: &mut Range, set: usize, yes: f32) -> bool {
        let x = 2.0 * stretch(yes.clamp(0.0005, 0.9995)) + 16.0;
        let low = (x as i32).clamp(0, 31) as usize;
        let part = x - low as f32;
        let (a, b) = (self.sets[set][low], self.sets[set][low + 1]);
        let bit = range.choose(chance_of_no(a.yes + part * (b.yes - a.yes)));
        let p = &mut self.sets[set][if part >= 0.5 { low + 1 } else { low }];
        p.yes += (one_if(bit) - p.yes) * rate(p.seen);
        p.seen = (p.seen + 1).min(255);
        bit
    }
}
