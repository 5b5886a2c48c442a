//! A vertex that may split, its neighbours, and the ways in which it may.

use super::vector::Vector;

/// Vertices with more triangles are never split. A simplifier keeps to 18 for the two ends of a collapse; splits of neighbours that
/// come first add some.
pub(super) const VALENCE_LIMIT: usize = 32;
/// Room for the neighbours of such a vertex.
pub(super) const SIDES: usize = VALENCE_LIMIT + 2;

/// Which triangles a new vertex takes: an arc inside the fan, or one that begins or ends at the boundary.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Side {
    /// From one neighbour to another: two new triangles.
    #[default]
    Inside,
    /// From the fan's clockwise end: one new triangle.
    Head,
    /// To the fan's counter-clockwise end: one new triangle.
    Tail,
}

/// One way to split: neighbours `from` to `to` become the new vertex's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Way {
    pub(super) side: Side,
    pub(super) from: u8,
    /// Beyond the number of neighbours where it runs past the fan's start.
    pub(super) to: u8,
}

impl Way {
    pub(super) fn range(self) -> (usize, usize) {
        (usize::from(self.from), usize::from(self.to))
    }
    /// Its kind: whether it lies in a closed fan, in an open one, or along the boundary.
    pub(super) fn kind(self, closed: bool) -> usize {
        match self.side {
            Side::Inside => usize::from(!closed),
            Side::Head => 2,
            Side::Tail => 3,
        }
    }
}

/// What is known of a neighbour.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Neighbour {
    pub(super) vertex: u32,
    pub(super) position: Vector<f32>,
    /// Mean edge length there.
    pub(super) edge: f32,
    pub(super) valence: u16,
    /// 0: its own splits are to come; 1: they are known; 2: new in this level.
    pub(super) state: u8,
    /// Levels since it came.
    pub(super) age: u8,
}

/// A vertex that may split, and its neighbours counter-clockwise.
#[derive(Clone, Debug)]
pub(super) struct Center {
    pub(super) position: Vector<f32>,
    /// Mean edge length, when it was last asked.
    pub(super) edge: f32,
    pub(super) count: usize,
    around: [Neighbour; SIDES],
    pub(super) closed: bool,
    pub(super) age: usize,
    /// Splits of it in this level so far.
    pub(super) splits: usize,
    /// First neighbour at which an arc may begin.
    pub(super) first: usize,
    /// What is known of a seam through here.
    pub(super) seam: Seam,
}

impl Default for Center {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            edge: 0.0,
            count: 0,
            around: [Neighbour::default(); SIDES],
            closed: false,
            age: 0,
            splits: 0,
            first: 0,
            seam: Seam::Quiet,
        }
    }
}

impl Center {
    pub(super) fn push(&mut self, neighbour: Neighbour) {
        self.around[self.count] = neighbour;
        self.count += 1;
    }
    pub(super) fn neighbours(&self) -> &[Neighbour] {
        &self.around[..self.count]
    }
}

/// What another wedge at the position of a vertex says of its splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Seam {
    /// None has split along the boundary, or all that did have their counterparts.
    #[default]
    Quiet,
    /// One has split at its fan's clockwise end, and waits for a counterpart.
    Head,
    /// One at the other end.
    Tail,
    /// This vertex has: the mesh may go on across.
    Own,
}
