//! Sums of squared distances to weighted planes: ten numbers and a weight.

/// `p' A p + 2 b p + c`, and the sum of the weights.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, xy, xz, yy, yz, zz.
    a: [f64; 6],
    b: [f64; 3],
    c: f64,
    /// Sum of weights: cost / weight is a mean squared distance.
    pub(super) weight: f64,
}

pub(super) use crate::vector::{Point, cross, dot, sub};

impl Quadric {
    /// `weight` × squared distance to the plane through `p` with unit normal `n`.
    pub(super) fn plane(p: Point, n: Point, weight: f64) -> Self {
        let d = -dot(n, p);
        Self {
            a: [n[0] * n[0], n[0] * n[1], n[0] * n[2], n[1] * n[1], n[1] * n[2], n[2] * n[2]].map(|x| x * weight),
            b: n.map(|x| x * d * weight),
            c: d * d * weight,
            weight,
        }
    }
    /// `weight` × squared distance to a point; adds nothing to the weight.
    pub(super) fn point(p: Point, weight: f64) -> Self {
        Self { a: [weight, 0.0, 0.0, weight, 0.0, weight], b: p.map(|x| -x * weight), c: dot(p, p) * weight, weight: 0.0 }
    }
    pub(super) fn add(&mut self, o: &Self) {
        (0..6).for_each(|k| self.a[k] += o.a[k]);
        (0..3).for_each(|k| self.b[k] += o.b[k]);
        self.c += o.c;
        self.weight += o.weight;
    }
    /// The cost at `p`, never negative.
    pub(super) fn at(&self, p: Point) -> f64 {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let [x, y, z] = p;
        let square = xx * x * x + yy * y * y + zz * z * z + 2.0 * (xy * x * y + xz * x * z + yz * y * z);
        (square + 2.0 * dot(self.b, p) + self.c).max(0.0)
    }
    /// The point of least cost, or `None` where planes do not pin one down.
    pub(super) fn minimum(&self) -> Option<Point> {
        let [xx, xy, xz, yy, yz, zz] = self.a;
        let (rx, ry, rz) = ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz]);
        let determinant = dot(rx, cross(ry, rz));
        let trace = xx + yy + zz;
        if determinant.abs() < 1e-9 * trace * trace * trace {
            return None;
        }
        // The inverse of a symmetric matrix has the cross products of its rows as rows.
        let minus_b = self.b.map(|x| -x);
        let p = [cross(ry, rz), cross(rz, rx), cross(rx, ry)].map(|row| dot(row, minus_b) / determinant);
        p.iter().all(|x| x.is_finite()).then_some(p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_where_the_minimum_is() {
        let mut q = Quadric::default();
        for (k, d) in [1.0, 2.0, 3.0].into_iter().enumerate() {
            let mut n = [0.0; 3];
            n[k] = 1.0;
            q.add(&Quadric::plane([d, d, d], n, 2.0));
        }
        let p = q.minimum().expect("they meet");
        assert!(q.at(p) < 1e-12);
        assert!(sub(p, [1.0, 2.0, 3.0]).iter().all(|x| x.abs() < 1e-12));
        assert!((q.at([2.0, 2.0, 3.0]) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_single_plane_has_no_minimum_point() {
        assert!(Quadric::plane([0.0; 3], [0.0, 0.0, 1.0], 1.0).minimum().is_none());
    }
}
