//! The client's end: what it has, its front, and what it asks for.

use crate::error::ProtocolError;
use crate::message::{Reply, Request, Shape, read_reply, request};
use crate::splits::{SplitModels, read};
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Allowance, Front, NONE, Progress, UnderWay, View};

/// A model that arrives as it is looked at. Messages are what [`Self::poll`] gives and [`Self::receive`] takes; after a break [`Self::reconnect`] says what to begin with.
#[derive(Debug, Default)]
pub struct Client {
    name: String,
    front: Front,
    grid: Quantisation,
    fingerprint: Option<u64>,
    total: u64,
    models: Box<SplitModels>,
    out: Option<Vec<u8>>,
    /// The server has answered the first message of this connection.
    is_open: bool,
    /// The last view asked for, and whether the server is done with it.
    asked: Option<(View, bool)>,
    limits: Limits,
    allowance: Allowance,
    is_drawn: bool,
    /// Smallest and largest corner of the model's box.
    extent: [[f32; 3]; 2],
    splits: u64,
    evictions: u64,
    bytes: (u64, u64),
}

/// What a client may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Triangles of the front. The tolerance gets coarser until the view does with so many.
    pub triangles: usize,
    /// Bytes of what is known ([`Front::memory_bytes`]): what lies below the front is forgotten when there are more, and the front stays so small that half of them is enough for it.
    pub memory: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self { triangles: usize::MAX, memory: usize::MAX }
    }
}

/// Bytes that a triangle of a front takes at most, what is above the front included: half a node of the front, and as much above it.
const TRIANGLE_BYTES: usize = 96;

impl Client {
    /// For the model of that name.
    pub fn new(name: &str) -> Self {
        let hello = request(&Request::Hello { model: name.into() });
        Self { name: name.into(), out: Some(hello), ..Default::default() }
    }
    /// The next message for the server.
    pub fn poll(&mut self) -> Option<Vec<u8>> {
        let message = self.out.take()?;
        self.bytes.0 += message.len() as u64;
        Some(message)
    }
    /// Takes a message of the server. Errors: the session is over; what arrived before stays, and [`Self::reconnect`] may go on from there.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<(), ProtocolError> {
        self.bytes.1 += bytes.len() as u64;
        match read_reply(bytes)? {
            Reply::Base(base) => {
                if self.fingerprint.is_some() {
                    return Err(ProtocolError::Unexpected("a second base mesh"));
                }
                self.front = Front::new(base.positions, &base.bounds, base.triangles, base.unit)?;
                if self.is_drawn {
                    self.front.draw();
                }
                self.is_open = true;
                self.extent = base.extent;
                (self.grid, self.fingerprint, self.total) = (base.grid, Some(base.fingerprint), base.total);
            }
            Reply::Resumed if self.fingerprint.is_some() => self.is_open = true,
            // Said before the server knew what was forgotten here: it says what is still needed again.
            Reply::Splits(_) | Reply::Done if self.fingerprint.is_some() && !self.is_open => {}
            Reply::Splits(packet) if self.fingerprint.is_some() => {
                self.splits += u64::from(read(&mut self.models, &mut self.front, (&self.grid, self.total), packet)?);
            }
            Reply::Done => {
                if let Some(asked) = &mut self.asked {
                    asked.1 = true;
                }
            }
            Reply::Error(text) => return Err(ProtocolError::Closed(text)),
            _ => return Err(ProtocolError::Unexpected("a reply before the base mesh")),
        }
        Ok(())
    }
    /// The front is to be drawn, from the base mesh on: changes are geomorphs ([`Front::draw`]), which [`Self::advance`] moves.
    pub fn draw(mut self) -> Self {
        self.is_drawn = true;
        self
    }
    /// Moves what is under way: [`Front::advance`].
    pub fn advance(&mut self, view: &View, step: f64, budget: u32) -> Result<UnderWay, ProtocolError> {
        Ok(self.front.advance(view, step, budget)?)
    }
    /// The front, for who draws it and takes what has changed.
    pub fn front_mut(&mut self) -> &mut Front {
        &mut self.front
    }
    /// What the client may take from now on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }
    /// Forgets what lies below the front, and tells the server on the same connection. O(what is here).
    fn evict(&mut self) {
        self.front.forget_below();
        self.evictions += 1;
        self.reconnect();
    }

    /// The connection is new, perhaps to another server: the next message says what is here already (E.7). O(what is here).
    pub fn reconnect(&mut self) {
        *self.models = SplitModels::default();
        // What was on its way is asked for again.
        self.asked = None;
        self.is_open = false;
        self.out = Some(match self.fingerprint {
            None => request(&Request::Hello { model: self.name.clone() }),
            Some(fingerprint) => request(&Request::Resume { model: self.name.clone(), fingerprint, shape: self.shape() }),
        });
    }
    fn shape(&self) -> Shape {
        let mut shape = Shape::default();
        let mut stack: Vec<u32> = (0..self.front.root_count()).rev().collect();
        while let Some(i) = stack.pop() {
            let child = self.front.node(i).map_or(NONE, |n| n.child);
            shape.push(child != NONE);
            if child != NONE {
                stack.extend([child + 1, child]);
            }
        }
        shape
    }

    /// Follows a view, with at most `budget` looks at nodes: refines what is here, and asks for what is not (E.13). A view waits until it is polled, and a newer one takes its place; none is asked for
    /// that the server is still at or has done with. Keeps the limits. Errors: what arrived is no hierarchy.
    pub fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, ProtocolError> {
        let view = self.allowance.view(view);
        let limit = self.limits.triangles.min(self.limits.memory / 2 / TRIANGLE_BYTES).max(1);
        self.front.limit_triangles(limit);
        let progress = self.front.refine(&view, budget)?;
        let leaving = self.front.under_way().leaving;
        self.allowance.learn(&progress, (self.front.len(), leaving), self.front.triangles(), limit);
        if self.is_open && self.front.memory_bytes() > self.limits.memory && self.front.known() > 2 * self.front.len() {
            self.evict();
            return Ok(progress);
        }
        let is_new = self.asked.is_none_or(|(asked, _)| asked != view);
        // What waits is a view, or the first message.
        let may_ask = self.out.is_none() || (self.is_open && self.asked.is_some());
        if progress.wants_more && is_new && may_ask {
            self.out = Some(request(&Request::View(Box::new(view))));
            self.asked = Some((view, false));
        }
        Ok(progress)
    }
    /// Says goodbye.
    pub fn close(&mut self) {
        self.out = Some(request(&Request::Bye));
    }

    /// The front and its mesh.
    pub fn front(&self) -> &Front {
        &self.front
    }
    /// Nodes of the whole hierarchy, once the base mesh is here.
    pub fn total(&self) -> u64 {
        self.total
    }
    /// True once nothing is left to ask for.
    pub fn has_all(&self) -> bool {
        self.fingerprint.is_some() && self.front.known() as u64 >= self.total
    }
    /// True if the server owes an answer: to the first message, or to a view.
    pub fn is_waiting(&self) -> bool {
        !self.is_open || self.asked.is_some_and(|a| !a.1)
    }
    /// True if there is nothing to show yet.
    pub fn is_empty(&self) -> bool {
        self.fingerprint.is_none()
    }
    /// Smallest and largest corner of the model's bounding box, once the base mesh is here.
    pub fn extent(&self) -> [[f32; 3]; 2] {
        self.extent
    }
    /// By how much the tolerance is coarser than asked for, for the limits' sake: in quarters of an octave.
    pub fn allowance(&self) -> u32 {
        self.allowance.step()
    }
    /// Times that something was forgotten.
    pub fn evictions(&self) -> u64 {
        self.evictions
    }
    /// Splits received.
    pub fn splits(&self) -> u64 {
        self.splits
    }
    /// Bytes sent, and received.
    pub fn bytes(&self) -> (u64, u64) {
        self.bytes
    }
}
