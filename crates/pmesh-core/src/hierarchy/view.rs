//! What a viewer sees, and which nodes are too coarse for it (E.8, E.10).

use super::bounds::Bounds;
use thiserror::Error;

/// A view that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ViewError {
    /// A number that is not finite, or not positive where it must be.
    #[error("a view's {0} must be a finite, positive number")]
    NotPositive(&'static str),
    /// The matrix.
    #[error("a view's matrix must be finite and have an inverse")]
    BadMatrix,
}

/// A camera and what it may be off by: the paper's view packet.
///
/// Made by [`View::new`] only, so that its numbers are good. Nothing but + − × ÷ and square roots is computed: both ends decide alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    matrix: [f32; 16],
    tangent: f32,
    aspect: f32,
    tolerance: f32,
    eye: [f64; 3],
    /// Normals into the frustum, with their offsets: left, right, bottom, top, and the eye's plane.
    planes: [[f64; 4]; 5],
    /// κ²: squared error that shows, at the squared distance 1.
    error: f64,
}

impl View {
    /// `matrix` takes the model's space to the eye's (looking along −z), by columns; `tangent` is that of half the vertical angle of view; `aspect` is
    /// width ÷ height; `tolerance` is a part of the viewport's height (one pixel of 1,000: 0.001).
    pub fn new(matrix: [f32; 16], tangent: f32, aspect: f32, tolerance: f32) -> Result<Self, ViewError> {
        for (name, x) in [("angle", tangent), ("aspect", aspect), ("tolerance", tolerance)] {
            if !(x.is_finite() && x > 0.0) {
                return Err(ViewError::NotPositive(name));
            }
        }
        let m = matrix.map(f64::from);
        let column = |i: usize| [m[4 * i], m[4 * i + 1], m[4 * i + 2]];
        let (a, b, c, d) = (column(0), column(1), column(2), column(3));
        let determinant = dot(a, cross(b, c));
        let eye = [dot(d, cross(b, c)), dot(a, cross(d, c)), dot(a, cross(b, d))].map(|x| -x / determinant);
        // A plane n · p ≥ 0 of the eye's space, in the model's.
        let plane = |n: [f64; 3]| {
            let in_model = [dot(a, n), dot(b, n), dot(c, n)];
            let length = dot(in_model, in_model).sqrt();
            let [x, y, z] = in_model.map(|x| x / length);
            [x, y, z, dot(d, n) / length]
        };
        let (t, s) = (f64::from(tangent), f64::from(tangent) * f64::from(aspect));
        let planes = [[1.0, 0.0, -s], [-1.0, 0.0, -s], [0.0, 1.0, -t], [0.0, -1.0, -t], [0.0, 0.0, -1.0]].map(plane);
        let good = m[3] == 0.0 && m[7] == 0.0 && m[11] == 0.0 && m[15] == 1.0;
        if !good || !eye.iter().chain(planes.iter().flatten()).all(|x| x.is_finite()) {
            return Err(ViewError::BadMatrix);
        }
        Ok(Self { matrix, tangent, aspect, tolerance, eye, planes, error: 0.0 }.with_error())
    }
    /// From `eye` to `target`, `up` about upward; the rest as [`Self::new`].
    pub fn look_at(
        eye: [f32; 3],
        target: [f32; 3],
        up: [f32; 3],
        [tangent, aspect, tolerance]: [f32; 3],
    ) -> Result<Self, ViewError> {
        let (e, t, u) = (eye.map(f64::from), target.map(f64::from), up.map(f64::from));
        let unit = |v: [f64; 3]| v.map(|x| x / dot(v, v).sqrt());
        let back = unit([e[0] - t[0], e[1] - t[1], e[2] - t[2]]);
        let right = unit(cross(u, back));
        let top = cross(back, right);
        let mut m = [0.0f32; 16];
        for (row, axis) in [right, top, back].into_iter().enumerate() {
            (0..3).for_each(|k| m[4 * k + row] = axis[k] as f32);
            m[12 + row] = -dot(axis, e) as f32;
        }
        m[15] = 1.0;
        Self::new(m, tangent, aspect, tolerance)
    }
    /// Wants everything: what is left once a view has all it needs, or what a client that will not move the camera asks for.
    pub fn everything() -> Self {
        let planes = [[0.0, 0.0, 0.0, 1.0]; 5];
        Self { matrix: [0.0; 16], tangent: 0.0, aspect: 0.0, tolerance: 0.0, eye: [0.0; 3], planes, error: 0.0 }
    }
    /// True if it wants everything.
    pub fn is_everything(&self) -> bool {
        self.tangent == 0.0
    }
    /// The same with so many times the tolerance. Everything stays everything.
    pub fn coarser(&self, factor: f64) -> Self {
        Self { tolerance: (f64::from(self.tolerance) * factor).min(f32::MAX.into()) as f32, ..*self }.with_error()
    }
    fn with_error(mut self) -> Self {
        let kappa = 2.0 * f64::from(self.tolerance) * f64::from(self.tangent);
        self.error = kappa * kappa;
        self
    }
    /// How far a vertex at `position` may move, whichever way, to move by at most `part` of the viewport's height in the picture. One that lies outside may move farther, by an eighth of
    /// how far outside, since of its triangles only their tips are seen; infinite behind the eye. O(1).
    pub fn reach(&self, position: [f32; 3], part: f64) -> f64 {
        let p = position.map(f64::from);
        let off = |n: &[f64; 4]| n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + n[3];
        let depth = off(&self.planes[4]);
        if self.is_everything() || depth <= 0.0 || part.is_infinite() {
            return f64::INFINITY;
        }
        let from_eye: [f64; 3] = std::array::from_fn(|k| p[k] - self.eye[k]);
        // A point at depth z and distance d moves by m d / z² at most in a picture at the distance 1. It may come nearer by m meanwhile.
        let scale = part * 2.0 * f64::from(self.tangent) * depth;
        let nearer = scale / (1.0 + scale / depth);
        let inside = nearer * depth / dot(from_eye, from_eye).sqrt().max(depth) * 0.95;
        let outside = self.planes[..4].iter().map(|n| -off(n)).fold(0.0, f64::max);
        inside + outside / 8.0
    }
    /// Matrix (by columns), tangent of half the angle of view, aspect, tolerance.
    pub fn parts(&self) -> ([f32; 16], f32, f32, f32) {
        (self.matrix, self.tangent, self.aspect, self.tolerance)
    }
    /// Where the eye is, in the model's space.
    pub fn eye(&self) -> [f64; 3] {
        self.eye
    }

    /// True if a node at `position` is too coarse: in sight, not turned away, and off by more than the tolerance (E.10). `unit` is that of the
    /// lengths in `bounds`. O(1).
    pub fn needs_more_than(&self, position: [f32; 3], bounds: &Bounds, unit: f64) -> bool {
        if bounds.is_leaf() {
            return false;
        }
        if self.is_everything() {
            return true;
        }
        let p = position.map(f64::from);
        let from_eye = [p[0] - self.eye[0], p[1] - self.eye[1], p[2] - self.eye[2]];
        let squared = dot(from_eye, from_eye);
        let radius = Bounds::length(bounds.radius, unit);
        // Among what the node stands for.
        let is_inside = squared <= radius * radius;
        let uniform = Bounds::length(bounds.uniform, unit);
        let directional = Bounds::length(bounds.directional, unit);
        let shows = uniform * uniform >= self.error * squared;
        // Most nodes of a front are fine enough, whichever way they face: that is looked at first.
        let may_show = shows || directional * directional >= self.error * squared;
        if !is_inside && !may_show {
            return false;
        }
        if self.planes.iter().any(|n| n[0] * p[0] + n[1] * p[1] + n[2] * p[2] + n[3] < -radius) {
            return false;
        }
        if is_inside {
            return true;
        }
        let along = dot(from_eye, bounds.direction());
        if let Some(sine) = bounds.sine().filter(|_| along > 0.0) {
            // Every triangle of the ball must be turned away, wherever in it.
            if along - radius > (squared.sqrt() + radius) * sine {
                return false;
            }
        }
        let aside = (squared - along * along).max(0.0);
        shows || directional * directional * aside >= self.error * squared * squared
    }
}

pub(super) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> View {
        View::look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0], [0.5, 1.0, 0.01]).expect("a view")
    }
    fn bounds(radius: f64, uniform: f64, angle: u8, axis: [f64; 3]) -> Bounds {
        let code = |x| Bounds::length_code(x, 10.0);
        Bounds { radius: code(radius), uniform: code(uniform), directional: 0, axis: Bounds::axis_code(axis), angle }
    }

    #[test]
    fn e10_in_sight_facing_and_off() {
        let v = view();
        assert!(v.eye().iter().zip([0.0, 0.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-6));
        let seen = bounds(0.1, 0.1, 0, [0.0, 0.0, 1.0]);
        assert!(v.needs_more_than([0.0; 3], &seen, 10.0));
        assert!(!v.needs_more_than([0.0; 3], &bounds(0.1, 0.1, 0, [0.0, 0.0, -1.0]), 10.0), "turned away");
        assert!(v.needs_more_than([0.0; 3], &bounds(0.1, 0.1, Bounds::NO_CONE, [0.0, 0.0, -1.0]), 10.0), "every way");
        assert!(!v.needs_more_than([4.0, 0.0, 0.0], &seen, 10.0), "out of sight");
        assert!(!v.needs_more_than([0.0, 0.0, 9.0], &seen, 10.0), "behind");
        // κ d = 2 · 0.01 · 0.5 · 5 = 0.05.
        assert!(!v.needs_more_than([0.0; 3], &bounds(0.1, 0.03, 0, [0.0, 0.0, 1.0]), 10.0), "good enough");
        assert!(!v.needs_more_than([0.0; 3], &Bounds { radius: 255, ..Default::default() }, 10.0), "a leaf");
        let along = Bounds { directional: Bounds::length_code(0.3, 10.0), uniform: 0, ..seen };
        assert!(!v.needs_more_than([0.0; 3], &along, 10.0), "seen from above a bump does not show");
        let side = Bounds { axis: Bounds::axis_code([1.0, 0.0, 0.0]), ..along };
        assert!(v.needs_more_than([0.0; 3], &side, 10.0), "from the side it does");
    }

    #[test]
    fn views_that_are_none_are_refused() {
        let (matrix, ..) = view().parts();
        for bad in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
            assert!(View::new(matrix, bad, 1.0, 0.01).is_err());
            assert!(View::new(matrix, 1.0, 1.0, bad).is_err());
        }
        assert_eq!(View::new([0.0; 16], 1.0, 1.0, 0.01), Err(ViewError::BadMatrix));
        let mut nan = matrix;
        nan[5] = f32::NAN;
        assert_eq!(View::new(nan, 1.0, 1.0, 0.01), Err(ViewError::BadMatrix));
    }
}
