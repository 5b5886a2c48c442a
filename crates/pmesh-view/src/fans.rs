//! Bounds of the two nodes that a split makes, predicted by their fans in the mesh of all that is known.

use crate::numbers::number;
use pmesh_codec::range::{Chance, Coder, INPUTS, Mixer};
use pmesh_core::hierarchy::Bounds;

/// Values that a tree of choices has; the last is one that others follow.
const VALUES: usize = 32;
const ESCAPE: i32 = VALUES as i32 - 1;
/// Values of a context.
const CONTEXTS: usize = 16;

/// A number near zero, by six contexts at once.
#[derive(Clone, Debug)]
struct Mixed {
    mixers: Box<[Mixer; VALUES]>,
    /// By context and its value.
    tables: Box<[[[Chance; VALUES]; CONTEXTS]; INPUTS]>,
    escape: [Chance; 32],
}

impl Default for Mixed {
    fn default() -> Self {
        Self {
            mixers: Box::new(std::array::from_fn(|_| Mixer::default())),
            tables: Box::new([[[Chance::default(); VALUES]; CONTEXTS]; INPUTS]),
            escape: [Chance::default(); 32],
        }
    }
}

impl Mixed {
    /// Codes a value of 0 to 255, small ones as cheap as their context has them.
    fn code<C: Coder>(&mut self, coder: &mut C, contexts: [i32; INPUTS], value: i32) -> i32 {
        let [a, b, c, d, e, f] = contexts.map(|x| x.clamp(0, CONTEXTS as i32 - 1) as usize);
        let [ta, tb, tc, td, te, tf] = &mut *self.tables;
        let symbol = value.clamp(0, ESCAPE) as usize;
        let mut node = 1;
        for bit in (0..VALUES.ilog2()).rev() {
            let chances =
                [&mut ta[a][node], &mut tb[b][node], &mut tc[c][node], &mut td[d][node], &mut te[e][node], &mut tf[f][node]];
            let bit = coder.mixed(&mut self.mixers[node], chances, symbol >> bit & 1 == 1);
            node = node << 1 | usize::from(bit);
        }
        match (node - VALUES) as i32 {
            ESCAPE => number(coder, &mut self.escape, value.wrapping_sub(ESCAPE) as u32).min(1 << 10) as i32 + ESCAPE,
            small => small,
        }
    }
}

/// A whole number as one that is not negative, small ones first.
fn fold(x: i32) -> i32 {
    x.wrapping_shl(1) ^ (x >> 31)
}
fn unfold(x: i32) -> i32 {
    x >> 1 ^ -(x & 1)
}

/// What a fan says of the node in its middle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Fan {
    /// Code of how far it reaches.
    reach: u8,
    /// Codes of its mean normal.
    axis: [i8; 2],
    /// Sine of the angle about that which has the normals of all its triangles, in parts of 15.
    sine: i32,
    count: i32,
}

impl Fan {
    /// Of the points about `own`, counter-clockwise. O(n).
    pub(crate) fn of(own: [f64; 3], about: &[[f64; 3]], closed: bool, unit: f64) -> Self {
        let sub = |a: [f64; 3]| [a[0] - own[0], a[1] - own[1], a[2] - own[2]];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let n = about.len();
        let normal = |i: usize| {
            let (a, b) = (sub(about[i]), sub(about[(i + 1) % n]));
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let triangles = if closed { n } else { n.saturating_sub(1) };
        let sum = (0..triangles).map(normal).fold([0.0; 3], |s, x| [s[0] + x[0], s[1] + x[1], s[2] + x[2]]);
        let axis = Bounds::axis_code(sum);
        let direction = Bounds { axis, ..Default::default() }.direction();
        let cosine = |x: [f64; 3]| {
            let length = dot(x, x).sqrt();
            if length > 0.0 { dot(x, direction) / length } else { 1.0 }
        };
        let least = (0..triangles).map(|i| cosine(normal(i))).fold(1.0, f64::min);
        let sine = if least > 0.0 { (1.0 - least * least).max(0.0).sqrt() } else { 1.0 };
        let reach = about.iter().map(|&p| dot(sub(p), sub(p))).fold(0.0, f64::max).sqrt();
        Self { reach: Bounds::length_code(reach, unit), axis, sine: (sine * 15.0) as i32, count: triangles.min(64) as i32 }
    }
    /// What its node's parent may have for bounds, if there is no parent.
    pub(crate) fn above(&self) -> Bounds {
        let radius = self.reach.saturating_add(8) | 1;
        Bounds { radius, uniform: radius, directional: radius, axis: self.axis, angle: Bounds::NO_CONE - 1 }
    }
}

/// What is learnt of bounds.
#[derive(Clone, Debug, Default)]
pub(crate) struct FanBounds {
    radius: Mixed,
    angle: Mixed,
    axis: [Mixed; 2],
    /// Along the axis, and along the surface; and whichever way, without a cone.
    errors: [Mixed; 3],
    /// The error along the surface is the least that there can be, by the cone's angle and the child.
    least: [Chance; 8],
}

impl FanBounds {
    /// Bytes that all of it takes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let tables = size_of::<[[[Chance; VALUES]; CONTEXTS]; INPUTS]>();
        size_of::<Self>() + 7 * (tables + size_of::<[Mixer; VALUES]>())
    }
    /// Codes the bounds of child `k` of a node of that size, which is no leaf; `first` are those of the other child, if that came before and is none either.
    pub(crate) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        (k, size): (usize, usize),
        (parent, first): (&Bounds, Option<&Bounds>),
        fan: &Fan,
        truth: &Bounds,
    ) -> Bounds {
        let int = |x: u8| i32::from(x);
        // By how much less, around the end.
        let less = |a: u8, b: u8| int(a.wrapping_sub(b));
        let (k, size) = (k as i32, size as i32);
        let [before, angle] = [int(parent.radius), int(parent.angle)];
        let had_cone = parent.angle < Bounds::NO_CONE;
        let mut child = Bounds::default();
        // Radii are odd.
        let above = (before - int(fan.reach)) / 2;
        let other = first.map_or(-1, |f| (before - int(f.radius)) / 2);
        let contexts = [above + 4, 2 * other + 2 + k, size, 3 * angle + k, (above + 2).clamp(0, 7) * 2 + k, fan.count];
        let closer = self.radius.code(coder, contexts, less(parent.radius, truth.radius) / 2);
        child.radius = parent.radius.wrapping_sub((closer as u8).wrapping_mul(2));
        let contexts = [
            2 * angle + k,
            fan.sine,
            first.map_or(0, |f| 1 + int(f.angle)),
            size,
            (fan.sine / 4) * 4 + angle.min(3),
            closer.min(3) * 4 + angle.min(3),
        ];
        child.angle = self.angle.code(coder, contexts, int(truth.angle)).min(Bounds::NO_CONE.into()) as u8;
        let angle = int(child.angle);
        let off = |of: i32, f: &Bounds, error: u8| 1 + (of - int(error)) / 2 + if f.angle == Bounds::NO_CONE { 0 } else { 1 };
        if child.angle == Bounds::NO_CONE {
            let before = int(parent.uniform.max(parent.directional));
            let beside = (int(parent.radius) - before) / 2;
            let contexts = [
                closer * 2 + k,
                beside + 4,
                first.map_or(0, |f| off(before, f, f.uniform.max(f.directional))),
                size,
                fan.sine,
                fan.count,
            ];
            let better = self.errors[2].code(coder, contexts, less(before as u8, truth.uniform));
            child.uniform = (before as u8).wrapping_sub(better as u8);
            return child;
        }
        for a in 0..2 {
            let guess = i32::from(fan.axis[a]);
            let turn = if had_cone { i32::from(parent.axis[a]) - guess } else { 7 };
            let other = if a == 1 { i32::from(child.axis[0]) - i32::from(fan.axis[0]) } else { 0 };
            let contexts = [turn + 8, 4 * angle + k, fan.sine, other + 8, size, fan.count * 2 + k];
            let off = self.axis[a].code(coder, contexts, fold(i32::from(truth.axis[a]) - guess));
            child.axis[a] = (guess + unfold(off)) as i8;
        }
        // Without a cone the parent's error is one of both kinds.
        let before = if had_cone { parent.directional } else { parent.uniform };
        let beside = int(parent.radius) - int(before);
        let contexts = [
            closer * 2 + k,
            beside / 2 - 2,
            first.map_or(0, |f| off(int(before), f, f.directional)),
            size,
            3 * angle + k,
            (int(child.radius) - int(before)) / 4 + 4,
        ];
        let better = unfold(self.errors[0].code(coder, contexts, fold(int(before) - int(truth.directional))));
        child.directional = int(before).wrapping_sub(better) as u8;
        child.uniform = Bounds::least_uniform(child.directional);
        if coder.bit(&mut self.least[(2 * angle + k).clamp(0, 7) as usize], truth.uniform == child.uniform) {
            return child;
        }
        let contexts = [
            3 * angle + k,
            (int(child.directional) - int(parent.uniform)) / 2 + 8,
            closer * 2 + k,
            first.map_or(0, |f| off(int(parent.uniform), f, f.uniform)),
            size,
            better + 1,
        ];
        let better = self.errors[1].code(coder, contexts, less(parent.uniform, truth.uniform));
        child.uniform = parent.uniform.wrapping_sub(better as u8);
        child
    }
}
