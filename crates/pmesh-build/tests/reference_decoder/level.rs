//! Sections 6.1 to 6.4, 6.6 and 6.7: a level, its line of vertices, splits and seams.

use super::floats::{V32, add, cross, dot, sub, unit32};
use super::frame::Bytes;
use super::mixer::Mixer;
use super::place::Places;
use super::range::{Chance, Number, Range, Signed};
use super::surface::{Surface, next, previous, vertex};
use super::ways::{Gathered, Side, Tables, Way, Weighed};
use super::{Mesh, NONE};

/// What is known of a vertex (6.2).
#[derive(Clone, Default)]
pub struct Known {
    pub position: V32,
    pub edge: f32,
    pub normal: V32,
    pub valence: u16,
    pub birth: u32,
    pub asked: u32,
    pub exact: bool,
    pub next: usize,
    pub miss: [f32; 2],
}

/// A vertex that a split along a boundary brought in this level (6.7).
pub struct Fresh {
    pub vertex: usize,
    pub from: usize,
    pub side: Side,
    pub shared: u32,
}

/// What outlives levels (6.2), and what lasts one.
pub struct Levels {
    pub level: u32,
    pub known: Vec<Known>,
    pub surface: Surface,
    pub attribute: Vec<Signed>,
    pub places: Places,
    pub fresh: Vec<Vec<Fresh>>,
    pub start: usize,
    mean_edge: f64,
    flag: Mixer,
    again: Mixer,
    tables: Tables,
    link: Vec<Number>,
    sharper: [Chance; 3],
    end: usize,
    edges: f64,
}

impl Levels {
    pub fn new(mesh: &Mesh) -> Self {
        Self {
            level: 0,
            known: Vec::new(),
            surface: Surface::new(mesh),
            attribute: vec![Signed::default(); mesh.width - 3],
            places: Places::default(),
            fresh: Vec::new(),
            start: 0,
            mean_edge: 0.0,
            flag: Mixer::new(&[1024, 768, 480], 4, 0.5 / 3.0, 0.7),
            again: Mixer::new(&[1296, 1152, 576, 1296, 2304], 1, 0.2, 0.4),
            tables: Tables::new(),
            link: vec![Number::default(); 4],
            sharper: [Chance::default(); 3],
            end: 0,
            edges: 0.0,
        }
    }

    /// 6.1 and 6.3.
    pub fn level(&mut self, mesh: &mut Mesh, block: &[u8], nv: usize) -> Result<(), String> {
        let mut frame = Bytes { bytes: block, at: 0 };
        let reach = frame.varint().map_err(|e| format!("9.1: no varint in front of a level: {e}"))?;
        let mut range = Range::start(&block[frame.at..]);
        self.start = mesh.count();
        self.end = self.start + nv;
        self.level += 1;
        self.fresh = (0..self.end).map(|_| Vec::new()).collect();
        self.edges = 0.0;
        self.places.begin_level(range.even());
        if self.level == 1 {
            self.begin(mesh);
        }
        self.sharpen(mesh, &mut range, reach)?;
        self.places.mean_edge = self.mean_edge;
        let mut at = 0;
        for _ in 0..self.start {
            let following = self.known[at].next;
            range.piece_begins();
            self.ask(mesh, &mut range, at)?;
            range.piece_ends(reach)?;
            self.known[at].asked = self.level;
            at = following;
        }
        if mesh.count() != self.end {
            return Err("6.3: not all vertices of a level".into());
        }
        self.mean_edge = self.edges / self.start.max(1) as f64;
        range.check()
    }

    /// 6.3, step 4.
    fn begin(&mut self, mesh: &Mesh) {
        for v in 0..self.start {
            let known = Known { position: mesh.position(v), next: v + 1, miss: [0.03, 0.08], ..Default::default() };
            self.known.push(known);
        }
        for v in mesh.triangles.iter().flatten() {
            self.known[*v].valence = self.known[*v].valence.saturating_add(1);
        }
        for v in 0..self.start {
            let (mut n, mut s, mut m) = ([0.0; 3], 0.0, 0.0);
            let start = self.surface.corner_of[v];
            let corners = if start == NONE { Vec::new() } else { self.surface.around(mesh, start).corners };
            for c in corners {
                let a = sub(self.known[vertex(mesh, next(c))].position, self.known[v].position);
                let b = sub(self.known[vertex(mesh, previous(c))].position, self.known[v].position);
                n = add(n, cross(a, b));
                s += dot(a, a).sqrt();
                m += 1.0;
            }
            self.known[v].normal = unit32(n);
            self.known[v].edge = if m == 0.0 { 0.0 } else { s / m };
            self.mean_edge += f64::from(self.known[v].edge);
        }
        self.mean_edge /= self.start.max(1) as f64;
    }

    /// 6.3, step 5.
    fn sharpen(&mut self, mesh: &mut Mesh, range: &mut Range, reach: u32) -> Result<(), String> {
        while mesh.shift > 0 {
            range.piece_begins();
            let sharper = range.even();
            range.piece_ends(reach)?;
            if !sharper {
                break;
            }
            mesh.shift -= 1;
            self.mean_edge *= 2.0;
            for v in 0..self.start {
                range.piece_begins();
                for k in 0..3 {
                    mesh.rows[v][k] = if mesh.first[v] < v {
                        mesh.value(mesh.first[v], k)
                    } else {
                        mesh.value(v, k).wrapping_mul(2).wrapping_add(i32::from(range.bit(&mut self.sharper[k])))
                    };
                }
                range.piece_ends(reach)?;
                self.known[v].position = mesh.position(v);
                self.known[v].edge *= 2.0;
            }
        }
        Ok(())
    }

    /// 6.4.
    fn ask(&mut self, mesh: &mut Mesh, range: &mut Range, p: usize) -> Result<(), String> {
        let level = self.level.min(7) as usize;
        let (mut last, mut splits, mut moved) = (NONE, 0, 0);
        let mut before: Option<(Gathered, Weighed, f32)> = None;
        while mesh.count() < self.end {
            if let Some((g, w, rest)) = &before {
                let b = ((rest * 1.5 + 8.0) as i32).clamp(0, 15) as usize;
                let s = splits.min(3);
                let valence = usize::from(self.known[p].valence).min(17);
                let at = [
                    (valence * 18 + moved) * 4 + s,
                    (b * 4 + s) * 18 + g.n.min(17),
                    (g.own_age.min(5) * 16 + w.mean_length) * 6 + w.fresh_count.min(5),
                    (w.free_count.min(17) * 18 + moved) * 4 + s,
                    (b * 8 + level) * 18 + moved,
                ];
                if !self.again.mixed(range, 0, &at, *rest) {
                    break;
                }
            }
            let Some(g) = self.gather(mesh, p, last, splits) else { break };
            let w = self.tables.weigh(&g);
            self.known[p].edge = w.own_edge;
            self.known[p].normal = w.own_normal;
            if splits == 0 {
                self.edges += f64::from(w.own_edge);
            }
            if !w.any {
                break;
            }
            if splits == 0 {
                let b = ((w.opinion * 1.5 + 8.0) as i32).clamp(0, 15) as usize;
                let done = g.state.iter().filter(|s| **s != 0).count();
                let at = [
                    (g.n.min(17).min(15) * 16 + b) * 4 + g.seam,
                    (b * 8 + level) * 6 + w.fresh_count.min(5),
                    (g.own_age.min(5) * 16 + w.mean_length) * 5 + (4 * done / g.n).min(4),
                ];
                if !self.flag.mixed(range, g.seam, &at, w.opinion) {
                    self.tables.learn(&g, &w, None);
                    break;
                }
            }
            let (way, rest) = self.tables.choose(range, &g, &w);
            self.tables.learn(&g, &w, Some(&way));
            let v = self.split(mesh, p, &g, &way)?;
            let shared = self.seam(mesh, range, p, v, way.side)?;
            self.place(mesh, range, p, v, shared)?;
            last = v;
            splits += 1;
            moved = (way.to - way.from).min(17);
            before = Some((g, w, rest));
        }
        Ok(())
    }

    /// 6.6. What is not known of the new vertex yet is 0.
    fn split(&mut self, mesh: &mut Mesh, p: usize, g: &Gathered, way: &Way) -> Result<usize, String> {
        let v = mesh.count();
        let count = g.corners.len();
        let corner = |i: usize| g.corners[(i + g.begin) % count];
        let moving: Vec<usize> = (way.from..way.to).map(corner).collect();
        if (1..moving.len()).any(|i| moving[..i].iter().any(|c| c / 3 == moving[i] / 3)) {
            return Err("6.6: two corners of a triangle".into());
        }
        let (n0, nm) = (g.ring[way.from % g.n], g.ring[way.to % g.n]);
        let new = match way.side {
            Side::Inside => {
                self.surface.split_inside(mesh, v, p, &moving);
                2
            }
            Side::Head => {
                let beside = if way.to < count { Some(g.corners[way.to]) } else { None };
                self.surface.split_head(mesh, v, p, &moving, nm, beside);
                1
            }
            Side::Tail => {
                let beside = if way.from > 0 { Some(corner(way.from - 1)) } else { None };
                self.surface.split_tail(mesh, v, p, &moving, n0, beside);
                1
            }
        };
        let moved_now = way.to - way.from;
        if way.side != Side::Tail {
            self.known[nm].valence = self.known[nm].valence.saturating_add(1);
        }
        if way.side != Side::Head {
            self.known[n0].valence = self.known[n0].valence.saturating_add(1);
        }
        self.known[p].valence = (self.known[p].valence + new).wrapping_sub(moved_now as u16);
        self.known.push(Known { valence: moved_now as u16 + new, ..Default::default() });
        mesh.push(vec![0; mesh.width]);
        mesh.representatives.push((v, p));
        Ok(v)
    }

    /// 6.7: the vertex whose position the new one has, if any.
    fn seam(&mut self, mesh: &Mesh, range: &mut Range, p: usize, v: usize, side: Side) -> Result<Option<usize>, String> {
        if !mesh.with_seams || side == Side::Inside {
            return Ok(None);
        }
        let list = &mut self.fresh[mesh.first[p]];
        let mut shared = None;
        if !list.is_empty() {
            let m = range.number(&mut self.link[list.len().min(4) - 1]) as usize;
            if m > list.len() {
                return Err("6.7: a seam to nothing".into());
            }
            if m > 0 {
                let at = list.len() - m;
                list[at].shared += 1;
                shared = Some(list[at].vertex);
            }
        }
        list.push(Fresh { vertex: v, from: p, side, shared: u32::from(shared.is_some()) });
        Ok(shared)
    }
}
