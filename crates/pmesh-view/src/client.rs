//! The client's end of a session: what it has, its front, and what it asks for.

use crate::error::ProtocolError;
use crate::message::{NAMED_LIMIT, Packets, Reply, Request, Shape, read_reply, request};
use crate::splits::{SplitModels, read, read_plain};
use crate::viewer::{Limits, SPLITS_A_BYTE, Viewer};
use pmesh_core::hierarchy::{Front, NONE, Progress, View};

/// A model that arrives as it is looked at. Messages are what [`Self::poll`] gives and [`Self::receive`] takes; after a break [`Self::reconnect`] says what to begin with.
#[derive(Debug, Default)]
pub struct Client {
    name: String,
    packets: Packets,
    /// Asks by the names of nodes instead of views.
    by_names: bool,
    viewer: Viewer,
    models: Box<SplitModels>,
    out: Option<Vec<u8>>,
    /// Goodbye has been said, or is about to be.
    is_closing: bool,
    /// The server has answered the first message of this connection.
    is_open: bool,
    /// The last view asked for, and whether the server is done with it.
    asked: Option<(View, bool)>,
    bytes: (u64, u64),
}

impl Client {
    /// For the model of that name.
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), ..Default::default() }.begin()
    }
    fn begin(mut self) -> Self {
        self.reconnect();
        self
    }
    /// The same, of packets of another kind. With [`Packets::CutsOnly`] what is here stays split, and each view is asked for.
    pub fn with_packets(self, packets: Packets) -> Self {
        Self { packets, ..self }.begin()
    }
    /// The same, that names the nodes to be split instead of sending views (E.19): more up, and the server decides nothing.
    pub fn by_names(self) -> Self {
        Self { by_names: true, ..self }
    }
    /// The front is to be drawn, from the base mesh on: changes are geomorphs ([`Front::draw`]), which [`Viewer::advance`] moves.
    pub fn draw(mut self) -> Self {
        self.viewer.is_drawn = true;
        self
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
        let v = &mut self.viewer;
        match read_reply(bytes)? {
            Reply::Error(text) => return Err(ProtocolError::Closed(text)),
            Reply::Refused(text) => return Err(ProtocolError::Refused(text)),
            Reply::Base(_) if !v.is_empty() => return Err(ProtocolError::Unexpected("a second base mesh")),
            Reply::Base(base) => {
                v.begin(base)?;
                if self.packets != Packets::Plain {
                    v.front.follow_cuts();
                }
                self.is_open = true;
            }
            _ if v.is_empty() => return Err(ProtocolError::Unexpected("a reply before the base mesh")),
            Reply::Resumed => self.is_open = true,
            // Said before the server knew what was forgotten here: it says what is still needed again.
            Reply::Splits(_) | Reply::Done if !self.is_open => {}
            Reply::Splits(packet) => {
                v.splits += u64::from(match self.packets {
                    Packets::Plain => read_plain(&mut v.front, v.total, packet)?,
                    _ => read(&mut self.models, &mut v.front, (&v.grid, v.total), packet)?,
                });
                if v.splits > SPLITS_A_BYTE * self.bytes.1 {
                    return Err(ProtocolError::Unexpected("more splits than its bytes can hold"));
                }
                // Cuts as they stand now are good for now.
                while self.packets == Packets::CutsOnly && v.front.refine(&View::everything(), u32::MAX)?.splits > 0 {}
            }
            Reply::Done if self.by_names && self.packets != Packets::CutsOnly => self.asked = None,
            Reply::Done => {
                if let Some(asked) = &mut self.asked {
                    asked.1 = true;
                }
            }
            Reply::Catalogue(_) => return Err(ProtocolError::Unexpected("a catalogue in a session")),
        }
        Ok(())
    }
    /// The connection is new, perhaps to another server: the next message says what is here already (E.7). O(what is here).
    pub fn reconnect(&mut self) {
        self.models = SplitModels::of(self.packets);
        // What was on its way is asked for again.
        self.asked = None;
        (self.is_open, self.is_closing) = (false, false);
        self.out = Some(match self.viewer.fingerprint {
            None => request(&Request::Hello { model: self.name.clone(), packets: self.packets }),
            Some(fingerprint) => {
                let (model, packets, shape) = (self.name.clone(), self.packets, self.shape());
                request(&Request::Resume { model, packets, fingerprint, shape })
            }
        });
    }
    fn shape(&self) -> Shape {
        let front = self.viewer.front();
        let mut shape = Shape::default();
        let mut stack: Vec<u32> = (0..front.root_count()).rev().collect();
        while let Some(i) = stack.pop() {
            let child = front.node(i).map_or(NONE, |n| n.child);
            shape.push(child != NONE);
            if child != NONE {
                stack.extend([child + 1, child]);
            }
        }
        shape
    }

    /// Follows a view, with at most `budget` looks at nodes: refines what is here, and asks for what is not (E.13). A view waits until it is polled, and a newer one takes its place; none is asked for
    /// that the server is still at or has done with. Keeps the limits: what is forgotten for their sake the server hears of on the same connection. Errors: what arrived is no hierarchy.
    pub fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, ProtocolError> {
        let (view, progress) = match self.packets {
            // It cannot tell what is too coarse.
            Packets::CutsOnly => (*view, Progress { wants_more: !self.has_all(), ..Default::default() }),
            _ => self.viewer.refine(view, budget)?,
        };
        if self.is_open && self.viewer.is_over(0) {
            self.viewer.front.forget_below();
            self.viewer.evictions += 1;
            self.reconnect();
            return Ok(progress);
        }
        let is_new = self.asked.is_none_or(|(asked, _)| asked != view);
        // What waits is a view, or the first message.
        let may_ask = !self.is_closing && (self.out.is_none() || (self.is_open && self.asked.is_some()));
        // Without bounds it can name nothing.
        let by_names = self.by_names && self.packets != Packets::CutsOnly;
        if progress.wants_more && is_new && may_ask && self.is_open && by_names {
            let front = self.viewer.front_mut();
            let mut nodes = front.take_wanted();
            nodes.sort_unstable();
            nodes.dedup();
            nodes.retain(|&i| front.node(i).is_some_and(|n| n.child == NONE));
            let names: Vec<_> = nodes.into_iter().take(NAMED_LIMIT).map(|i| front.id(i)).collect();
            if self.asked.is_none() && !names.is_empty() {
                self.out = Some(request(&Request::Split(names)));
                self.asked = Some((view, false));
            }
        } else if progress.wants_more && is_new && may_ask && !by_names {
            self.out = Some(request(&Request::View(Box::new(view))));
            self.asked = Some((view, false));
        }
        Ok(progress)
    }
    /// Says goodbye.
    pub fn close(&mut self) {
        self.out = Some(request(&Request::Bye));
        self.is_closing = true;
    }
    /// What the client may take from now on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.viewer.set_limits(limits);
    }

    /// What is here.
    pub fn viewer(&self) -> &Viewer {
        &self.viewer
    }
    /// The same, for who draws it.
    pub fn viewer_mut(&mut self) -> &mut Viewer {
        &mut self.viewer
    }
    /// The front and its mesh.
    pub fn front(&self) -> &Front {
        self.viewer.front()
    }
    /// Nodes of the whole hierarchy, once the base mesh is here.
    pub fn total(&self) -> u64 {
        self.viewer.total()
    }
    /// True once nothing is left to ask for.
    pub fn has_all(&self) -> bool {
        self.viewer.has_all()
    }
    /// True if the server owes an answer: to the first message, or to a view.
    pub fn is_waiting(&self) -> bool {
        !self.is_open || self.asked.is_some_and(|a| !a.1)
    }
    /// Splits received.
    pub fn splits(&self) -> u64 {
        self.viewer.splits()
    }
    /// Bytes sent, and received.
    pub fn bytes(&self) -> (u64, u64) {
        self.bytes
    }
}
