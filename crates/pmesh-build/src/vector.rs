//! Vectors of three doubles.

pub(crate) type Point = [f64; 3];

pub(crate) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
pub(crate) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
pub(crate) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
pub(crate) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
pub(crate) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// From the nearest point of a triangle to `p` (Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn from_triangle(p: Point, [a, b, c]: [Point; 3]) -> Point {
    let from_segment = |a: Point, b: Point| {
        let d = sub(b, a);
        let l = dot(d, d);
        let t = if l > 0.0 { (dot(sub(p, a), d) / l).clamp(0.0, 1.0) } else { 0.0 };
        let q: Point = std::array::from_fn(|k| a[k] + t * d[k]);
        sub(p, q)
    };
    let (u, v, w) = (sub(b, a), sub(c, a), sub(p, a));
    let (uu, uv, vv, wu, wv) = (dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v));
    let determinant = uu * vv - uv * uv;
    if determinant > 1e-30 {
        let (s, t) = ((vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant);
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            return std::array::from_fn(|k| w[k] - s * u[k] - t * v[k]);
        }
    }
    let nearer = |a: Point, b: Point| if dot(b, b) < dot(a, a) { b } else { a };
    nearer(nearer(from_segment(a, b), from_segment(b, c)), from_segment(c, a))
}
