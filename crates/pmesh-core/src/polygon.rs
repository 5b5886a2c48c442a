//! Polygons to triangles: convex ones as a fan from their first corner, others by cutting ears.

type Point = [f64; 3];

/// Larger concave polygons are fanned: cutting ears can take cubic time.
const EAR_LIMIT: usize = 256;

/// Gives the triangles of the polygon `corners`, as indices into it. Degenerate polygons are fanned.
pub fn triangulate(corners: &[[f32; 3]], mut give: impl FnMut([usize; 3])) {
    let n = corners.len();
    let fan = |give: &mut dyn FnMut([usize; 3])| (2..n).for_each(|i| give([0, i - 1, i]));
    if !(4..=EAR_LIMIT).contains(&n) {
        return fan(&mut give);
    }
    let flat = flatten(corners);
    let convex = (0..n).all(|i| turn(flat[i], flat[(i + 1) % n], flat[(i + 2) % n]) >= 0.0);
    if convex { fan(&mut give) } else { cut_ears(&flat, &mut give) }
}

/// The polygon in the plane it fits best (Newell's normal), so that it runs counter-clockwise.
fn flatten(corners: &[[f32; 3]]) -> Vec<[f64; 2]> {
    let p: Vec<Point> = corners.iter().map(|c| c.map(f64::from)).collect();
    let mut normal = [0.0; 3];
    for (i, a) in p.iter().enumerate() {
        let b = p[(i + 1) % p.len()];
        for k in 0..3 {
            let (u, v) = ((k + 1) % 3, (k + 2) % 3);
            normal[k] += (a[u] - b[u]) * (a[v] + b[v]);
        }
    }
    // Drop the coordinate along which the normal is longest: no square root, no degenerate axis.
    let k = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(2);
    let (u, v) = if normal[k] >= 0.0 { ((k + 1) % 3, (k + 2) % 3) } else { ((k + 2) % 3, (k + 1) % 3) };
    p.iter().map(|c| [c[u], c[v]]).collect()
}

fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn cut_ears(flat: &[[f64; 2]], give: &mut impl FnMut([usize; 3])) {
    let mut left: Vec<usize> = (0..flat.len()).collect();
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&i| {
            let (a, b, c) = (left[(i + n - 1) % n], left[i], left[(i + 1) % n]);
            let inside = |p: [f64; 2]| {
                turn(flat[a], flat[b], p) >= 0.0 && turn(flat[b], flat[c], p) >= 0.0 && turn(flat[c], flat[a], p) >= 0.0
            };
            turn(flat[a], flat[b], flat[c]) > 0.0 && !left.iter().any(|&v| v != a && v != b && v != c && inside(flat[v]))
        });
        // A polygon that crosses itself may have no ear: cut the first corner all the same.
        let i = ear.unwrap_or(1);
        give([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    give([left[0], left[1], left[2]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[[f32; 3]], t: [usize; 3]) -> f64 {
        let [a, b, c] = t.map(|i| [f64::from(corners[i][0]), f64::from(corners[i][1])]);
        turn(a, b, c) / 2.0
    }

    #[test]
    fn a_concave_polygon_is_covered_once() {
        // An L, area 3, wound so that a fan from corner 0 would leave it.
        let l: Vec<[f32; 3]> = [[1., 1.], [1., 2.], [0., 2.], [0., 0.], [2., 0.], [2., 1.]].map(|[x, y]| [x, y, 0.]).to_vec();
        let mut areas = Vec::new();
        triangulate(&l, |t| areas.push(area(&l, t)));
        assert_eq!(areas.len(), 4);
        assert!(areas.iter().all(|&a| a > 0.0), "{areas:?}");
        assert_eq!(areas.iter().sum::<f64>(), 3.0);
    }

    #[test]
    fn a_convex_polygon_is_a_fan_from_its_first_corner() {
        let mut triangles = Vec::new();
        triangulate(&[[0., 0., 5.], [1., 0., 5.], [1., 1., 5.], [0., 1., 5.]], |t| triangles.push(t));
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
    }
}
