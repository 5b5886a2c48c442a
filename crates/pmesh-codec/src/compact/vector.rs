//! Vectors of three, in single and double precision.

use std::ops::{Add, Mul, Sub};

pub(super) type Vector<T> = [T; 3];

#[inline(always)]
pub(super) fn add<T: Copy + Add<Output = T>>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
#[inline(always)]
pub(super) fn sub<T: Copy + Sub<Output = T>>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
#[inline(always)]
pub(super) fn scale<T: Copy + Mul<Output = T>>(a: Vector<T>, s: T) -> Vector<T> {
    [a[0] * s, a[1] * s, a[2] * s]
}
#[inline(always)]
pub(super) fn dot<T: Copy + Add<Output = T> + Mul<Output = T>>(a: Vector<T>, b: Vector<T>) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
#[inline(always)]
pub(super) fn cross<T: Copy + Sub<Output = T> + Mul<Output = T>>(a: Vector<T>, b: Vector<T>) -> Vector<T> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
#[inline(always)]
pub(super) fn length(a: Vector<f32>) -> f32 {
    dot(a, a).sqrt()
}
