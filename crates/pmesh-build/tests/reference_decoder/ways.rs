//! Section 6.4, `gather`, and section 6.5 as far as `weigh`.

use super::floats::{V32, add, cross, dot, exp, larger, ln, octaves, scale, smaller, sub, sum32, unit32};
use super::level::Levels;
use super::{Mesh, NONE};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Side {
    Inside,
    Head,
    Tail,
}

pub struct Way {
    pub side: Side,
    pub from: usize,
    pub to: usize,
}

impl Way {
    pub fn kind(&self, closed: bool) -> usize {
        match self.side {
            Side::Inside if closed => 0,
            Side::Inside => 1,
            Side::Head => 2,
            Side::Tail => 3,
        }
    }
}

/// What `gather` gives.
pub struct Gathered {
    pub corners: Vec<usize>,
    pub closed: bool,
    pub begin: usize,
    pub n: usize,
    /// The neighbours.
    pub ring: Vec<usize>,
    pub first_from: usize,
    pub position: Vec<V32>,
    pub edge: Vec<f32>,
    pub valence: Vec<usize>,
    pub state: Vec<usize>,
    pub age: Vec<usize>,
    pub own_position: V32,
    pub own_edge: f32,
    pub own_age: usize,
    pub splits: usize,
    pub seam: usize,
}

impl Levels {
    pub fn gather(&self, mesh: &Mesh, p: usize, last: usize, splits: usize) -> Option<Gathered> {
        let valence = usize::from(self.known[p].valence);
        if valence == 0 || valence > 32 || self.surface.corner_of[p] == NONE {
            return None;
        }
        let fan = self.surface.around(mesh, self.surface.corner_of[p]);
        if fan.corners.len() != valence {
            return None;
        }
        let n = fan.ring.len();
        let mut begin = 0;
        if fan.closed {
            let lowest = fan.ring.iter().min().copied().unwrap_or(NONE);
            let place_of = |v: usize| fan.ring.iter().position(|r| *r == v);
            begin = place_of(last).or(place_of(lowest)).unwrap_or(0);
        }
        let mut ring = fan.ring;
        ring.rotate_left(begin);
        let first_from = ring.iter().rposition(|r| *r == last).map_or(0, |i| i + 1);
        let state = |&r: &usize| {
            if r >= self.start {
                2
            } else if self.known[r].asked == self.level {
                1
            } else {
                0
            }
        };
        let age = |v: usize| (self.level - self.known[v].birth) as usize;
        let mut seam = 0;
        if mesh.with_seams {
            for f in &self.fresh[mesh.first[p]] {
                if f.from == p {
                    seam = 3;
                } else if f.shared == 0 {
                    seam = if f.side == Side::Head { 1 } else { 2 };
                }
            }
        }
        Some(Gathered {
            corners: fan.corners,
            closed: fan.closed,
            begin,
            n,
            first_from,
            position: ring.iter().map(|&r| self.known[r].position).collect(),
            edge: ring.iter().map(|&r| self.known[r].edge).collect(),
            valence: ring.iter().map(|&r| usize::from(self.known[r].valence)).collect(),
            state: ring.iter().map(state).collect(),
            age: ring.iter().map(|&r| age(r)).collect(),
            ring,
            own_position: self.known[p].position,
            own_edge: self.known[p].edge,
            own_age: age(p),
            splits,
            seam,
        })
    }
}

/// Left cut, right cut, inside, against.
pub type Roles = [f32; 4];

pub fn times(a: Roles, b: Roles) -> Roles {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3]]
}
pub fn bounded(x: f32, l: f32) -> f32 {
    larger(smaller(x, l), 1.0 / l)
}

pub struct Tables {
    /// `KIND`, `BEND`, `AGE`, `RUN`.
    pub roles: [Vec<Roles>; 4],
    pub arc: Vec<Vec<Vec<f32>>>,
    pub seam: [[f32; 4]; 4],
    pub no: Vec<Vec<f32>>,
    pub angle: Vec<f32>,
    pub offset: Vec<f32>,
    pub chord: Vec<f32>,
    pub seen: f32,
    pub ways_seen: f32,
    pub lessons: u64,
}

/// What `weigh` gives. What has a place for each neighbour has it twice, for places `i ≥ n`.
pub struct Weighed {
    pub triangles: usize,
    /// Kind of inside ways.
    pub k: usize,
    pub arm: Vec<V32>,
    pub sq: Vec<f32>,
    pub free: Vec<bool>,
    pub factor: Vec<Roles>,
    pub at: Vec<[usize; 4]>,
    pub own_edge: f32,
    pub own_normal: V32,
    pub mean_length: usize,
    pub fresh_count: usize,
    pub free_count: usize,
    pub any: bool,
    pub no_at: [usize; 6],
    pub total: f32,
    pub chance: f32,
    pub ratio: f32,
    pub opinion: f32,
}

fn twice<T: Clone>(list: &[T]) -> Vec<T> {
    [list, list].concat()
}

impl Tables {
    pub fn new() -> Self {
        let at_first = |m: usize| {
            let x = m as f32;
            larger(exp(-0.075 * (x - 4.0) * (x - 4.0)), 1.0 / 1000.0)
        };
        let arc: Vec<f32> = (0..34).map(at_first).collect();
        let mut no = vec![vec![1.0; 34]; 6];
        no[0] = vec![20.0; 34];
        Self {
            roles: [480, 16, 30, 27].map(|size| vec![[1.0; 4]; size]),
            arc: vec![vec![arc; 34]; 4],
            seam: [[1.0; 4]; 4],
            no,
            angle: vec![1.0; 25],
            offset: vec![1.0; 14],
            chord: vec![1.0; 14],
            seen: 0.0,
            ways_seen: 0.0,
            lessons: 0,
        }
    }

    pub fn weigh(&self, g: &Gathered) -> Weighed {
        let (n, closed) = (g.n, g.closed);
        let (triangles, k) = if closed { (n, 0) } else { (n - 1, 1) };
        let mean = larger((2.0 * g.own_edge + sum32(g.edge.iter().copied())) / (n as f32 + 2.0), 1e-6);
        let u = 1.0 / mean;
        let arms: Vec<V32> = g.position.iter().map(|&r| scale(sub(r, g.own_position), u)).collect();
        let arm = twice(&arms);
        let sq: Vec<f32> = arm.iter().map(|&a| dot(a, a)).collect();
        let free: Vec<bool> = twice(&g.state).iter().map(|s| *s != 2).collect();
        let mut all = 0.0;
        for i in 0..n {
            all += sq[i];
        }
        let own_edge = mean * (all / n as f32).sqrt();
        let (mut normals, mut areas, mut sum) = (vec![[0.0; 3]; n + 1], vec![0.0; n + 1], [0.0; 3]);
        for i in 0..triangles {
            normals[i + 1] = cross(arm[i], arm[i + 1]);
            areas[i + 1] = dot(normals[i + 1], normals[i + 1]);
            sum = add(sum, normals[i + 1]);
        }
        normals[0] = normals[triangles];
        areas[0] = areas[triangles];
        let (mut long_sum, mut fresh_count, mut against) = (0, 0, 1.0);
        let (mut at, mut factor) = (Vec::new(), Vec::new());
        for i in 0..n {
            let long = octaves(sq[i], 1, 4, 16);
            long_sum += long;
            let d = dot(normals[i], normals[i + 1]);
            let q = areas[i] * areas[i + 1];
            let sine = if d > 0.0 { q - d * d } else { q + d * d };
            let inside = closed || (0 < i && i < triangles);
            let bend = if inside { octaves(larger(0.0, sine / larger(q, 1e-30)), 0, 13, 15) } else { 15 };
            let before = if closed || i > 0 { g.state[(i + n - 1) % n] } else { 1 };
            let after = if closed || i + 1 < n { g.state[(i + 1) % n] } else { 1 };
            let state = g.state[i];
            if state == 2 {
                fresh_count += 1;
            }
            at.push([
                (long * 10 + g.valence[i].clamp(3, 12) - 3) * 3 + state,
                bend,
                g.age[i].min(9) * 3 + state,
                (before * 3 + state) * 3 + after,
            ]);
            let [kind, bend, age, run] = [0, 1, 2, 3].map(|j| self.roles[j][at[i][j]]);
            let product = times(times(kind, bend), times(age, run)).map(|x| bounded(x, 1e8));
            against = larger(smaller(against * product[3], 1e8), 1.0 / 1e8);
            factor.push(if state == 2 { [0.0; 4] } else { product });
        }
        let mean_length = long_sum / n;
        let mut w = Weighed {
            triangles,
            k,
            arm,
            sq,
            free_count: (g.first_from..n).filter(|&i| free[i]).count(),
            free,
            factor: twice(&factor),
            at,
            own_edge,
            own_normal: unit32(sum),
            mean_length,
            fresh_count,
            any: false,
            no_at: [n, mean_length, fresh_count, g.own_age, g.splits, g.seam].map(|x| x.min(33)),
            total: 0.0,
            chance: 0.0,
            ratio: 0.0,
            opinion: 0.0,
        };
        self.total(g, &mut w);
        let product = (1..6).fold(self.no[0][w.no_at[0]], |a, i| a * self.no[i][w.no_at[i]]);
        let no = product * against;
        w.chance = w.total / (w.total + no);
        w.ratio = w.total / no;
        w.opinion = ln(larger(w.total / no, 1e-9)).clamp(-8.0, 8.0);
        w
    }

    /// `total` and `any`.
    fn total(&self, g: &Gathered, w: &mut Weighed) {
        let (n, k, factor) = (g.n, w.k, &w.factor);
        for from in (g.first_from..n).filter(|&from| w.free[from]) {
            let (mut inner, mut row) = (factor[from][0], 0.0);
            let end = if g.closed { from + n } else { n };
            for to in from + 1..end {
                row += inner * factor[to][1] * self.arc[k][n][to - from];
                inner = smaller(inner * factor[to][2], 1e12);
            }
            w.total += row * self.seam[g.seam][k];
            w.any |= from + 1 < end && w.free[from + 1];
        }
        if g.closed {
            return;
        }
        if g.first_from == 0 {
            let (mut inner, mut row) = (1.0, 0.0);
            for to in 0..n {
                row += inner * factor[to][1] * self.arc[2][n][to];
                inner = smaller(inner * factor[to][2], 1e12);
            }
            w.total += row * self.seam[g.seam][2];
        }
        let (mut inner, mut row) = (1.0, 0.0);
        for from in (g.first_from..n).rev() {
            row += inner * factor[from][0] * self.arc[3][n][n - 1 - from];
            inner = smaller(inner * factor[from][2], 1e12);
        }
        w.total += row * self.seam[g.seam][3];
        w.any |= (g.first_from == 0 && w.free[0]) || (g.first_from < n && w.free[n - 1]);
    }
}
