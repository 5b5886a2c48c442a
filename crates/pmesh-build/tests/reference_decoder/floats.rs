//! Sections 1.2 and 1.3: vectors and functions of floats.

use std::ops::{Add, Mul, Sub};

pub const LN2: f32 = f32::from_bits(0x3f31_7218);
const LOG2E: f32 = f32::from_bits(0x3fb8_aa3b);
const PI: f32 = f32::from_bits(0x4049_0fdb);

pub type V32 = [f32; 3];
pub type V64 = [f64; 3];

pub trait Float: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {}
impl Float for f32 {}
impl Float for f64 {}

pub fn add<F: Float>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
pub fn sub<F: Float>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub fn scale<F: Float>(a: [F; 3], s: F) -> [F; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}
pub fn dot<F: Float>(a: [F; 3], b: [F; 3]) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub fn cross<F: Float>(a: [F; 3], b: [F; 3]) -> [F; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
pub fn unit32(a: V32) -> V32 {
    let l = dot(a, a).sqrt();
    scale(a, if l > 1e-12 { 1.0 / l } else { 0.0 })
}
pub fn unit64(a: V64, other: V64) -> V64 {
    let l = dot(a, a).sqrt();
    if l > 1e-9 { scale(a, 1.0 / l) } else { other }
}
pub fn mean_of(list: &[V64]) -> V64 {
    let mut s = [0.0; 3];
    for r in list {
        s = add(s, *r);
    }
    scale(s, 1.0 / list.len() as f64)
}
/// Σ: the first term, plus the second, and so on; −0 if there is none.
pub fn sum64(list: impl IntoIterator<Item = f64>) -> f64 {
    list.into_iter().fold(-0.0, |a, b| a + b)
}
pub fn sum32(list: impl IntoIterator<Item = f32>) -> f32 {
    list.into_iter().fold(-0.0, |a, b| a + b)
}

pub fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}
pub fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}
pub fn fit(x: f64, lo: f64, hi: f64) -> f64 {
    let y = if x > lo { x } else { lo };
    if y < hi { y } else { hi }
}

pub fn log2(x: f32) -> f32 {
    let b = x.to_bits();
    let f = f32::from_bits((b & 0x7f_ffff) | 0x3f80_0000) - 1.0;
    ((b >> 23) as i32 - 127) as f32 + f * (f32::from_bits(0x3fac_5d64) - f32::from_bits(0x3eb1_758e) * f)
}
pub fn stretch(p: f32) -> f32 {
    (log2(p) - log2(1.0 - p)) * LN2
}
pub fn exp(x: f32) -> f32 {
    let x = x.clamp(-80.0, 80.0);
    let t = x * LOG2E;
    let k = (t + if t < 0.0 { -0.5 } else { 0.5 }) as i32;
    let r = x - k as f32 * f32::from_bits(0x3f31_8000) + k as f32 * f32::from_bits(0x395e_8083);
    let s = 1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0));
    let e = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * s)));
    e * f32::from_bits(((k + 127) as u32) << 23)
}
pub fn squash(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}
pub fn ln(x: f32) -> f32 {
    let b = x.to_bits();
    let k = (b.wrapping_sub(0x3f35_04f3) as i32) >> 23;
    let m = f32::from_bits(b.wrapping_sub((k as u32) << 23));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    k as f32 * LN2 + 2.0 * s * (1.0 + q * (1.0 / 3.0 + q * (0.2 + q * (1.0 / 7.0 + q * (1.0 / 9.0)))))
}
pub fn arccos(x: f32) -> f32 {
    let a = x.clamp(-1.0, 1.0);
    let m = a.abs();
    let inner = f32::from_bits(0x3d98_1627) - m * f32::from_bits(0x3c99_6e30);
    let y = (1.0 - m).sqrt() * (f32::from_bits(0x3fc9_0da4) + m * (-f32::from_bits(0x3e59_3484) + m * inner));
    if a < 0.0 { PI - y } else { y }
}
pub fn growth(s: f32) -> f32 {
    1.0 + s * (1.0 + s * 0.5)
}
pub fn class(x: f32, limit: i32) -> usize {
    (x as i32).clamp(0, limit - 1) as usize
}
pub fn octaves(x: f32, fine: i32, one: i32, limit: i32) -> usize {
    let w = (x.to_bits() as i32) >> (23 - fine);
    (w - ((127 - one) << fine)).clamp(0, limit - 1) as usize
}
pub fn log(x: f64) -> f64 {
    f64::from(log2(fit(x, 1e-30, 1e30) as f32) * LN2)
}
