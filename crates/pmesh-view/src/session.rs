//! One client at the server.

use crate::error::ProtocolError;
use crate::message::{Packets, Reply, Request, Shape, read_request, reply};
use crate::model::Model;
use crate::splits::{Spent, SplitModels, write, write_plain};
use crate::tags::ActiveTags;
use pmesh_core::hierarchy::{NONE, NodeId, View};
use std::sync::Arc;

/// Nodes that are looked at before the next look at the budget.
const STRIDE: usize = 256;

/// Most splits that stand in each other's way, as clients have it.
const FORCED_LIMIT: usize = 1024;

/// What a session has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Splits sent.
    pub splits: u64,
    /// Bytes received.
    pub bytes_up: u64,
    /// Bytes sent.
    pub bytes_down: u64,
}

/// The server's side of a client: which nodes it has as leaves, and the last view. The front only moves down, so that each split is sent once (E.6, E.17).
#[derive(Clone, Debug)]
pub struct Session {
    model: Arc<Model>,
    tags: ActiveTags,
    packets: Packets,
    models: Box<SplitModels>,
    /// Nodes that the client has named, the next last; and that it waits for these.
    named: Option<Vec<u32>>,
    /// The view that is worked on.
    view: Option<View>,
    /// Where the look through the front is, and where it must go back to: children that came behind it.
    at: u32,
    again: u32,
    counts: Counts,
    waiting: Vec<u8>,
    /// The client is wrong about what it has: nothing can be sent any more.
    is_over: bool,
}

impl Session {
    /// From a client's first message; `find` gives the model of a name. Errors: bytes that are none, a model that is not there, and as [`Self::begin`].
    pub fn open(first: &[u8], find: impl FnOnce(&str) -> Option<Arc<Model>>) -> Result<Self, ProtocolError> {
        let request = read_request(first)?;
        let model = request.model().and_then(find).ok_or(ProtocolError::Unexpected("there is no model of that name"))?;
        Self::begin(request, first.len(), model)
    }
    /// From a client's first message, of so many bytes, and the model that it names. The first reply waits in [`Self::work`]. Errors: no first message, a model that is not the one that the
    /// client has. O(1), or O(what the client has).
    pub fn begin(first: Request, bytes: usize, model: Arc<Model>) -> Result<Self, ProtocolError> {
        let begin = |model: Arc<Model>, packets, tags, waiting| Self {
            model,
            tags,
            packets,
            models: SplitModels::of(packets),
            named: None,
            view: None,
            at: 0,
            again: NONE,
            counts: Counts { bytes_up: bytes as u64, ..Default::default() },
            waiting,
            is_over: false,
        };
        match first {
            Request::Hello { packets, .. } => {
                let tags = ActiveTags::new(model.hierarchy().root_count());
                let base = model.base().to_vec();
                Ok(begin(model, packets, tags, base))
            }
            Request::Resume { packets, fingerprint, shape, .. } => {
                let tags = leaves(&model, fingerprint, &shape)?;
                Ok(begin(model, packets, tags, reply(&Reply::Resumed)))
            }
            _ => Err(ProtocolError::Unexpected("a session begins with a hello")),
        }
    }

    /// Takes a message after the first. False if the client has said goodbye. A new view takes the place of one that is worked on; a client that has forgotten something
    /// resumes. O(1), or O(what the client has).
    pub fn receive(&mut self, bytes: &[u8]) -> Result<bool, ProtocolError> {
        self.counts.bytes_up += bytes.len() as u64;
        if self.is_over {
            return Err(ProtocolError::Unexpected("the session is over"));
        }
        match read_request(bytes)? {
            Request::View(view) => {
                (self.view, self.at, self.again, self.named) = (Some(*view), 0, NONE, None);
                Ok(true)
            }
            Request::Split(ids) => {
                // Names that are not there, or not any more, are nothing: what was forced may have been one of them.
                self.named = Some(ids.into_iter().rev().filter_map(|id| self.model.hierarchy().find(id)).collect());
                self.view = None;
                Ok(true)
            }
            // It has forgotten something.
            Request::Resume { packets, fingerprint, shape, .. } => {
                self.tags = leaves(&self.model, fingerprint, &shape)?;
                let spent = self.models.spent;
                (self.packets, self.models) = (packets, SplitModels::of(packets));
                self.models.spent = spent;
                (self.view, self.named, self.waiting) = (None, None, reply(&Reply::Resumed));
                Ok(true)
            }
            Request::Bye => Ok(false),
            _ => Err(ProtocolError::Unexpected("a session begins once")),
        }
    }

    /// Goes on: the next message for the client, of at most about `most` splits, and looking at no more than `budget` nodes; `None` if there is nothing to say yet,
    /// or at all ([`Self::is_idle`]). O(budget · depth).
    pub fn work(&mut self, most: u32, budget: u32) -> Option<Vec<u8>> {
        let message = if self.waiting.is_empty() { self.scan(most, budget)? } else { std::mem::take(&mut self.waiting) };
        self.counts.bytes_down += message.len() as u64;
        Some(message)
    }
    /// True if there is nothing to do until a message comes.
    pub fn is_idle(&self) -> bool {
        self.waiting.is_empty() && self.view.is_none() && self.named.is_none()
    }

    /// True if nothing more can be said to the client: it has heard why.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    /// Splits what was named.
    fn take_named(&mut self, most: u32) -> Option<Vec<u8>> {
        let mut splits = Vec::new();
        let mut named = self.named.take()?;
        while (splits.len() as u32) < most {
            let Some(i) = named.pop() else { break };
            if self.tags.contains(i) {
                self.split(i, &mut splits);
            }
        }
        if splits.is_empty() {
            return Some(reply(&Reply::Done));
        }
        self.named = Some(named);
        Some(self.packet(&splits))
    }
    fn packet(&mut self, splits: &[u32]) -> Vec<u8> {
        self.counts.splits += splits.len() as u64;
        let packet = match self.packets {
            Packets::Plain => Ok(write_plain(&self.model, splits)),
            _ => write(&mut self.models, &self.model, &self.tags, splits),
        };
        match packet {
            Ok(packet) => reply(&Reply::Splits(&packet)),
            // Only of a client that is wrong about what it has.
            Err(_) => {
                (self.view, self.named, self.is_over) = (None, None, true);
                reply(&Reply::Refused("the nodes that the client has make no mesh".into()))
            }
        }
    }
    fn scan(&mut self, most: u32, budget: u32) -> Option<Vec<u8>> {
        if self.named.is_some() {
            return self.take_named(most);
        }
        let view = self.view?;
        let most = most.min(crate::splits::PACKET_LIMIT / 2);
        let (mut splits, mut look) = (Vec::new(), Vec::with_capacity(STRIDE));
        let mut looked = 0;
        while looked < budget && (splits.len() as u32) < most {
            look.clear();
            self.tags.list(self.at, STRIDE, &mut look);
            let Some(&last) = look.last() else {
                if self.again == NONE {
                    self.view = None;
                    self.waiting = reply(&Reply::Done);
                    break;
                }
                (self.at, self.again) = (self.again, NONE);
                continue;
            };
            self.at = last + 1;
            for &i in &look {
                if (splits.len() as u32) >= most {
                    self.at = self.at.min(i);
                    break;
                }
                looked += 1;
                let node = &self.model.hierarchy().nodes()[i as usize];
                if self.tags.contains(i)
                    && view.needs_more_than(self.model.hierarchy().position(i), &node.bounds, self.model.hierarchy().unit())
                {
                    // The children may lie before the end of what was listed.
                    self.at = self.at.min(node.child);
                    let before = splits.len();
                    self.split(i, &mut splits);
                    // What was forced may have children behind.
                    let forced =
                        splits[before..].iter().filter(|&&s| s != i).map(|&s| self.model.hierarchy().nodes()[s as usize].child);
                    self.again = forced.min().filter(|&c| c < self.at).map_or(self.again, |c| c.min(self.again));
                }
            }
        }
        if splits.is_empty() {
            return self.view.is_none().then(|| std::mem::take(&mut self.waiting));
        }
        Some(self.packet(&splits))
    }

    /// SelStreamVSplit (E.11): first the node at which both cuts stand. Iterative; each step goes down, so it ends.
    fn split(&mut self, i: u32, splits: &mut Vec<u32>) {
        let h = self.model.hierarchy();
        let mut stack = vec![i];
        while let Some(&s) = stack.last() {
            let node = &h.nodes()[s as usize];
            let active = |cut: u32| if cut == NONE { None } else { h.active_ancestor(cut, |n| self.tags.contains(n)) };
            match node.cuts.map(active) {
                // A leaf cannot be both: no collapse has such cuts.
                [Some(a), Some(b)]
                    if a == b && h.nodes()[a as usize].child != NONE && stack.len() < FORCED_LIMIT && !stack.contains(&a) =>
                {
                    stack.push(a)
                }
                _ => {
                    stack.pop();
                    if self.tags.contains(s) && node.child != NONE {
                        splits.push(s);
                        self.tags.split(s, node.child);
                    }
                }
            }
        }
    }

    /// What has been done.
    pub fn counts(&self) -> Counts {
        self.counts
    }
    /// Bits of the splits sent, by what they say.
    pub fn spent(&self) -> Spent {
        self.models.spent
    }
    /// The front.
    pub fn tags(&self) -> &ActiveTags {
        &self.tags
    }
    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }
    /// Bytes of this session, the model not counted.
    pub fn memory_bytes(&self) -> usize {
        let named = self.named.as_ref().map_or(0, |n| 4 * n.capacity());
        size_of::<Self>() + self.models.memory_bytes() + self.tags.memory_bytes() + self.waiting.capacity() + named
    }
}

/// The leaves of a client's trees, from its walk through them. Errors: of another model, or of nodes that are not there.
fn leaves(model: &Model, fingerprint: u64, shape: &Shape) -> Result<ActiveTags, ProtocolError> {
    if model.fingerprint() != fingerprint {
        return Err(ProtocolError::OtherModel { expected: model.fingerprint(), found: fingerprint });
    }
    let h = model.hierarchy();
    let bad = ProtocolError::Unexpected("the client has nodes that are not there");
    let mut bits = shape.iter();
    let mut tags = ActiveTags::empty();
    let mut stack: Vec<u32> = Vec::with_capacity(NodeId::DEPTH_LIMIT as usize);
    for root in 0..h.root_count() {
        stack.push(root);
        while let Some(i) = stack.pop() {
            let Some(has_children) = bits.next() else { return Err(bad) };
            let child = h.nodes()[i as usize].child;
            match (has_children, child) {
                (false, _) => tags.insert(i),
                (true, NONE) => return Err(bad),
                (true, _) => stack.extend([child + 1, child]),
            }
        }
    }
    if bits.next().is_some() { Err(bad) } else { Ok(tags) }
}
