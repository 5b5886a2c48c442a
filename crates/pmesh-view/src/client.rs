//! The client's end: what it has, its front, and what it asks for.

use crate::error::ProtocolError;
use crate::message::{Reply, Request, Shape, read_reply, request};
use crate::splits::{SplitModels, read};
use pmesh_codec::pmesh::Quantisation;
use pmesh_core::hierarchy::{Front, NONE, Progress, View};

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
    splits: u64,
    bytes: (u64, u64),
}

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
                self.is_open = true;
                (self.grid, self.fingerprint, self.total) = (base.grid, Some(base.fingerprint), base.total);
            }
            Reply::Resumed if self.fingerprint.is_some() => self.is_open = true,
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

    /// Follows a view, with at most `budget` looks at nodes: refines what is here, and asks for what is not (E.13). One view a call at most, and none that the server is still at or has
    /// done with. Errors: what arrived is no hierarchy.
    pub fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, ProtocolError> {
        let progress = self.front.refine(view, budget)?;
        let is_new = self.asked.is_none_or(|(asked, _)| asked != *view);
        if progress.wants_more && is_new && self.out.is_none() {
            self.out = Some(request(&Request::View(Box::new(*view))));
            self.asked = Some((*view, false));
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
    /// Splits received.
    pub fn splits(&self) -> u64 {
        self.splits
    }
    /// Bytes sent, and received.
    pub fn bytes(&self) -> (u64, u64) {
        self.bytes
    }
}
