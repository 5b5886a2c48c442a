//! The front as it is drawn: every split and collapse is a geomorph, so that nothing jumps.
//!
//! A split's second vertex begins where the first is drawn, and moves to its own place; before a collapse it moves back. No vertex moves faster than asked
//! for, a pixel a frame, and normals turn as gently. Once a vertex has arrived it costs nothing.

use super::{Front, HierarchyError, NONE, View};

/// Part of the way that a normal turns in a frame.
const TURN: f32 = 0.25;
/// Squared distance of unit normals that nobody sees.
const CLOSE: f32 = 1e-4;
/// The same of such as point the other way.
const OPPOSITE: f32 = 3.9;

const MOVING: u8 = 1;
/// On its way to the vertex that it collapses onto.
const LEAVING: u8 = 2;
/// Its normal is to be looked at.
const TURNING: u8 = 4;
const CHANGED: u8 = 8;

/// Where the vertices are drawn. 25 bytes a vertex, and lists of those under way.
#[derive(Clone, Debug, Default)]
pub(super) struct Geomorphs {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    flags: Vec<u8>,
    moving: Vec<u32>,
    turning: Vec<u32>,
    changed: Vec<u32>,
    leaving: u32,
    /// Where the next frame goes on in the list of those that move.
    cursor: usize,
}

/// What is still on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnderWay {
    /// Vertices that move.
    pub moving: u32,
    /// Of these, such as collapse when they arrive.
    pub leaving: u32,
    /// Vertices whose normals turn.
    pub turning: u32,
}

impl Geomorphs {
    fn mark(&mut self, v: u32, flag: u8) {
        let flags = &mut self.flags[v as usize];
        let list = match flag {
            MOVING => &mut self.moving,
            TURNING => &mut self.turning,
            _ => &mut self.changed,
        };
        if *flags & flag == 0 {
            *flags |= flag;
            list.push(v);
        }
    }
    /// `blue` comes out of `red`.
    pub(super) fn split(&mut self, red: u32, blue: u32, ends: [u32; 2]) {
        let count = self.positions.len().max(blue as usize + 1);
        self.positions.resize(count, [0.0; 3]);
        self.normals.resize(count, [0.0; 3]);
        self.flags.resize(count, 0);
        self.positions[blue as usize] = self.positions[red as usize];
        self.normals[blue as usize] = self.normals[red as usize];
        self.stay(blue);
        self.mark(blue, MOVING);
        self.mark(blue, CHANGED);
        [red, blue, ends[0], ends[1]].into_iter().filter(|&v| v != NONE).for_each(|v| self.mark(v, TURNING));
    }
    /// Sends `blue` back to where it came from; false if it is on its way already.
    pub(super) fn leave(&mut self, blue: u32) -> bool {
        let is_new = self.flags[blue as usize] & LEAVING == 0;
        if is_new {
            self.flags[blue as usize] |= LEAVING;
            self.leaving += 1;
            self.mark(blue, MOVING);
        }
        is_new
    }
    pub(super) fn is_leaving(&self, blue: u32) -> bool {
        self.flags.get(blue as usize).is_some_and(|f| f & LEAVING != 0)
    }
    /// It does not leave, or no longer.
    pub(super) fn stay(&mut self, blue: u32) {
        if self.is_leaving(blue) {
            self.flags[blue as usize] &= !LEAVING;
            self.leaving -= 1;
        }
    }
    pub(super) fn under_way(&self) -> UnderWay {
        UnderWay { moving: self.moving.len() as u32, leaving: self.leaving, turning: self.turning.len() as u32 }
    }
    /// Keeps the vertices that have a new number, in order; these are all changed.
    pub(super) fn rename(&mut self, number: impl Fn(u32) -> Option<u32>) {
        fn keep<T: Copy>(list: &mut Vec<T>, number: impl Fn(u32) -> Option<u32>) {
            *list = list.iter().enumerate().filter(|(v, _)| number(*v as u32).is_some()).map(|(_, x)| *x).collect();
        }
        keep(&mut self.positions, &number);
        keep(&mut self.normals, &number);
        keep(&mut self.flags, &number);
        for list in [&mut self.moving, &mut self.turning] {
            *list = list.iter().filter_map(|&v| number(v)).collect();
        }
        self.flags.iter_mut().for_each(|f| *f |= CHANGED);
        self.changed = (0..self.flags.len() as u32).collect();
        self.leaving = self.flags.iter().filter(|&&f| f & LEAVING != 0).count() as u32;
        self.cursor = 0;
    }
    pub(super) fn memory_bytes(&self) -> usize {
        25 * self.positions.len()
    }
}

impl Front {
    /// From now on the front is drawn: it is where it is, and what changes from here on changes by [`Self::advance`]. O(front).
    pub fn draw(&mut self) {
        let mut g = Geomorphs { positions: self.positions.clone(), ..Default::default() };
        g.flags = vec![0; g.positions.len()];
        g.normals = (0..g.positions.len() as u32).map(|v| normal(&self.mesh, &g.positions, v).unwrap_or_default()).collect();
        (0..g.positions.len() as u32).for_each(|v| g.mark(v, CHANGED));
        self.mesh.watch();
        self.geomorphs = Some(g);
    }
    /// Where the vertices are drawn, those too that are not there now; empty if the front is not drawn.
    pub fn drawn_positions(&self) -> &[[f32; 3]] {
        self.geomorphs.as_ref().map_or(&[], |g| &g.positions)
    }
    /// Normals that the vertices are drawn with; zero where there is none.
    pub fn drawn_normals(&self) -> &[[f32; 3]] {
        self.geomorphs.as_ref().map_or(&[], |g| &g.normals)
    }
    /// Vertices that are drawn in another way than when last asked.
    pub fn take_changed_vertices(&mut self) -> Vec<u32> {
        let Some(g) = &mut self.geomorphs else { return Vec::new() };
        let changed = std::mem::take(&mut g.changed);
        changed.iter().for_each(|&v| g.flags[v as usize] &= !CHANGED);
        changed
    }
    /// Places in the list of triangles ([`super::FrontMesh::shown`]) that hold another triangle than when last asked, or one with other corners: some twice, and some past the end.
    pub fn take_changed_places(&mut self) -> Vec<u32> {
        self.mesh.take_changes()
    }
    /// What moves and turns.
    pub fn under_way(&self) -> UnderWay {
        self.geomorphs.as_ref().map(Geomorphs::under_way).unwrap_or_default()
    }

    /// Moves what is under way by a frame: no vertex by more than `step` of the viewport's height (one pixel of 1,000: 0.001; infinite: all at once), at most `budget` of them, and as many normals.
    /// O(budget · valence). Errors: as [`Self::refine`].
    pub fn advance(&mut self, view: &View, step: f64, budget: u32) -> Result<UnderWay, HierarchyError> {
        let Some(mut g) = self.geomorphs.take() else { return Ok(UnderWay::default()) };
        // Each at most once: what comes to a place that is free lies behind it.
        let mut left = budget;
        while left > 0 {
            let Some(&v) = g.moving.get(g.cursor) else {
                g.cursor = 0;
                break;
            };
            left -= 1;
            let leaving = g.is_leaving(v);
            let target = if leaving { g.positions[self.origin(v) as usize] } else { self.positions[v as usize] };
            let p = g.positions[v as usize];
            let way: [f64; 3] = std::array::from_fn(|k| f64::from(target[k]) - f64::from(p[k]));
            let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
            let most = view.reach(p, step);
            let arrives = length <= most;
            let part = most / length;
            let between = || std::array::from_fn(|k| (f64::from(p[k]) + way[k] * part) as f32);
            let now = if arrives { target } else { between() };
            // Steps that single precision does not have are none: it is as good as there.
            let arrives = arrives || now == p;
            g.positions[v as usize] = if arrives { target } else { now };
            if target != p {
                g.mark(v, CHANGED);
                self.mesh.around(v).flatten().for_each(|w| g.mark(w, TURNING));
            }
            if !arrives {
                g.cursor += 1;
                continue;
            }
            if leaving {
                let red = self.origin(v);
                g.stay(v);
                if !self.collapse_node(self.split_of(v)) {
                    // Its neighbourhood has changed meanwhile: back again.
                    g.cursor += 1;
                    continue;
                }
                g.mark(red, TURNING);
            }
            g.flags[v as usize] &= !MOVING;
            g.moving.swap_remove(g.cursor);
        }
        let mut turning = std::mem::take(&mut g.turning);
        // The oldest first; those that are not done come again.
        let rest = turning.split_off(turning.len().min(budget as usize));
        g.turning = rest;
        for v in turning {
            g.flags[v as usize] &= !TURNING;
            let Some(target) = normal(&self.mesh, &g.positions, v) else { continue };
            let n = g.normals[v as usize];
            let off: [f32; 3] = std::array::from_fn(|k| target[k] - n[k]);
            let far = off.iter().map(|x| x * x).sum::<f32>();
            // Nothing lies between a normal and its opposite.
            let at_once = !(CLOSE..OPPOSITE).contains(&far) || step.is_infinite() || n == [0.0; 3];
            let now: [f32; 3] =
                if at_once { target } else { unit(std::array::from_fn(|k| n[k] + off[k] * TURN)).unwrap_or(target) };
            if far > 0.0 {
                g.normals[v as usize] = now;
                g.mark(v, CHANGED);
            }
            if !at_once {
                g.mark(v, TURNING);
            }
        }
        let under_way = g.under_way();
        self.geomorphs = Some(g);
        Ok(under_way)
    }
    /// The node whose split brought a vertex.
    fn split_of(&self, blue: u32) -> u32 {
        let child = self.roots + 2 * (blue - self.roots);
        self.known[child as usize].parent
    }
    /// The vertex that it came out of.
    fn origin(&self, blue: u32) -> u32 {
        self.known[self.split_of(blue) as usize].vertex
    }
}

/// Mean of the normals about a vertex, by area.
fn normal(mesh: &super::FrontMesh, positions: &[[f32; 3]], v: u32) -> Option<[f32; 3]> {
    let mut sum = [0.0f32; 3];
    for t in mesh.around(v) {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        let (e, f): ([f32; 3], [f32; 3]) = (std::array::from_fn(|k| b[k] - a[k]), std::array::from_fn(|k| c[k] - a[k]));
        sum[0] += e[1] * f[2] - e[2] * f[1];
        sum[1] += e[2] * f[0] - e[0] * f[2];
        sum[2] += e[0] * f[1] - e[1] * f[0];
    }
    unit(sum)
}
fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    // Areas of fine triangles underflow when squared in single precision.
    let length = v.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|x| (f64::from(x) / length) as f32))
}
