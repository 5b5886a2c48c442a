//! Messages: a byte that says which, then what it says. The transport keeps them apart (a WebSocket does). docs/PROTOCOL.md has every byte.

use crate::base::{self, Base};
use crate::error::ProtocolError;
use pmesh_core::hierarchy::{NodeId, View};

/// Version of the protocol.
pub const VERSION: u8 = 2;
/// First bytes of a hello.
const MAGIC: [u8; 4] = *b"PMVD";
/// First byte of the message with the base mesh.
pub(crate) const BASE_KIND: u8 = 129;
/// Most bytes of a model's name.
const NAME_LIMIT: usize = 255;
/// Bytes of a node that is named, and most of them in a message.
const NAMED_BYTES: usize = 12;
pub(crate) const NAMED_LIMIT: usize = 4096;
/// Most names of a catalogue.
const CATALOGUE_LIMIT: usize = 1 << 16;
/// Most nodes that a client may say it has.
const NODE_LIMIT: u64 = 1 << 32;

/// How splits are sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Packets {
    /// Coded by chances that learn.
    #[default]
    Coded,
    /// The paper's packet as it stands (E.9): the reference that the coded one is measured by.
    Plain,
    /// Coded, with the cuts as they are in the client's front instead of leaves, and without bounds: for a client that keeps what it has, and asks with every view (E.19).
    CutsOnly,
}

/// What a client says.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Which models there are.
    Catalogue,
    /// The first message of a session: which model.
    Hello {
        /// Its name.
        model: String,
        /// How splits are to come.
        packets: Packets,
    },
    /// The first message after a break (E.7): the leaves of what the client has, as a walk through its trees, depth first: true where a node has children.
    Resume {
        /// The model's name.
        model: String,
        /// How splits are to come.
        packets: Packets,
        /// [`Base::fingerprint`].
        fingerprint: u64,
        /// Of the nodes known.
        shape: Shape,
    },
    /// What is looked at; or everything.
    View(Box<View>),
    /// Nodes to be split: instead of a view, of a client that decides by itself (E.19).
    Split(Vec<NodeId>),
    /// It was a pleasure.
    Bye,
}

impl Request {
    /// The model that a first message names.
    pub fn model(&self) -> Option<&str> {
        match self {
            Self::Hello { model, .. } | Self::Resume { model, .. } => Some(model),
            _ => None,
        }
    }
}

/// A walk through a client's trees, a bit a node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shape {
    bits: Vec<u8>,
    count: u64,
}

impl Shape {
    /// The next node: true if it has children.
    pub fn push(&mut self, has_children: bool) {
        let at = (self.count % 8) as u32;
        if at == 0 {
            self.bits.push(0);
        }
        if let Some(last) = self.bits.last_mut() {
            *last |= u8::from(has_children) << at;
        }
        self.count += 1;
    }
    /// Node after node.
    pub fn iter(&self) -> impl Iterator<Item = bool> {
        (0..self.count).map(|i| self.bits[(i / 8) as usize] >> (i % 8) & 1 == 1)
    }
}

impl FromIterator<bool> for Shape {
    fn from_iter<I: IntoIterator<Item = bool>>(nodes: I) -> Self {
        let mut shape = Self::default();
        nodes.into_iter().for_each(|n| shape.push(n));
        shape
    }
}

/// What a server says.
#[derive(Clone, Debug, PartialEq)]
pub enum Reply<'a> {
    /// The base mesh.
    Base(Base),
    /// The server goes on from where the client is.
    Resumed,
    /// A packet of [`crate::splits`].
    Splits(&'a [u8]),
    /// The last view has all that it needs.
    Done,
    /// Names of the models that there are.
    Catalogue(Vec<String>),
    /// Why the server closes.
    Error(String),
    /// Why the server closes, and would again.
    Refused(String),
}

/// Bytes of a request.
pub fn request(request: &Request) -> Vec<u8> {
    let mut out = Vec::new();
    // A name that is too long is cut, and will not be found.
    let name = |out: &mut Vec<u8>, model: &str| {
        let end = (0..=model.len().min(NAME_LIMIT)).rev().find(|&n| model.is_char_boundary(n)).unwrap_or(0);
        let bytes = &model.as_bytes()[..end];
        out.push(bytes.len() as u8);
        out.extend(bytes);
    };
    match request {
        Request::Catalogue => {
            out.push(6);
            out.extend(MAGIC);
            out.push(VERSION);
        }
        Request::Hello { model, packets } => {
            out.push(1);
            out.extend(MAGIC);
            out.extend([VERSION, *packets as u8]);
            name(&mut out, model);
        }
        Request::Resume { model, packets, fingerprint, shape } => {
            out.push(2);
            out.extend(MAGIC);
            out.extend([VERSION, *packets as u8]);
            name(&mut out, model);
            out.extend(fingerprint.to_le_bytes());
            out.extend(shape.count.to_le_bytes());
            out.extend(&shape.bits);
        }
        Request::View(view) if view.is_everything() => out.push(4),
        Request::View(view) => {
            out.push(3);
            let (matrix, tangent, aspect, tolerance) = view.parts();
            // The matrix's last row is 0 0 0 1.
            let rows = matrix.chunks(4).flat_map(|c| &c[..3]);
            rows.chain([&tangent, &aspect, &tolerance]).for_each(|x| out.extend(x.to_le_bytes()));
        }
        Request::Split(nodes) => {
            out.push(7);
            for id in nodes {
                out.extend(id.tree.to_le_bytes());
                out.extend(id.node.to_le_bytes());
            }
        }
        Request::Bye => out.push(5),
    }
    out
}

/// Reads a request. Errors: bytes that are none, a view that cannot be.
pub fn read_request(bytes: &[u8]) -> Result<Request, ProtocolError> {
    let mut r = Reader { bytes, at: 0 };
    let request = match r.u8()? {
        kind @ (1 | 2 | 6) => {
            if r.array::<4>()? != MAGIC {
                return r.error("this is not the view protocol");
            }
            if r.u8()? != VERSION {
                return r.error("another version of the protocol; load the page anew");
            }
            if kind == 6 {
                return r.end(Request::Catalogue);
            }
            let packets = match r.u8()? {
                0 => Packets::Coded,
                1 => Packets::Plain,
                2 => Packets::CutsOnly,
                _ => return r.error("packets of another kind"),
            };
            let length = r.u8()?.into();
            let Ok(model) = String::from_utf8(r.take(length)?.to_vec()) else { return r.error("a name that is no text") };
            if kind == 1 {
                Request::Hello { model, packets }
            } else {
                let fingerprint = u64::from_le_bytes(r.array()?);
                let count = u64::from_le_bytes(r.array()?);
                if count > NODE_LIMIT || count.div_ceil(8) != (bytes.len() - r.at) as u64 {
                    return r.error("a walk of another length than it says");
                }
                let shape = Shape { bits: r.take(bytes.len() - r.at)?.to_vec(), count };
                Request::Resume { model, packets, fingerprint, shape }
            }
        }
        3 => {
            let mut matrix = [0.0f32; 16];
            for column in matrix.chunks_mut(4) {
                for x in &mut column[..3] {
                    *x = r.f32()?;
                }
            }
            matrix[15] = 1.0;
            let (tangent, aspect, tolerance) = (r.f32()?, r.f32()?, r.f32()?);
            Request::View(Box::new(View::new(matrix, tangent, aspect, tolerance)?))
        }
        4 => Request::View(Box::new(View::everything())),
        5 => Request::Bye,
        7 => {
            if !(bytes.len() - 1).is_multiple_of(NAMED_BYTES) || bytes.len() / NAMED_BYTES > NAMED_LIMIT {
                return r.error("nodes of another length, or too many");
            }
            let id = |r: &mut Reader| Ok(NodeId { tree: u32::from_le_bytes(r.array()?), node: u64::from_le_bytes(r.array()?) });
            Request::Split((1..bytes.len()).step_by(NAMED_BYTES).map(|_| id(&mut r)).collect::<Result<_, ProtocolError>>()?)
        }
        _ => return r.error("no request begins so"),
    };
    r.end(request)
}

/// Bytes of a reply.
pub fn reply(reply: &Reply) -> Vec<u8> {
    match reply {
        // Of triangles between vertices that are not there nothing can be said but that.
        Reply::Base(b) => base::write(b).map_or_else(|e| self::reply(&Reply::Error(e.to_string())), |written| written.0),
        Reply::Resumed => vec![130],
        Reply::Splits(packet) => [&[131], *packet].concat(),
        Reply::Done => vec![132],
        Reply::Catalogue(names) => [&[134], names.join("\n").as_bytes()].concat(),
        Reply::Error(text) => [&[133], text.as_bytes()].concat(),
        Reply::Refused(text) => [&[135], text.as_bytes()].concat(),
    }
}

/// Reads a reply. Errors: bytes that are none.
pub fn read_reply(bytes: &[u8]) -> Result<Reply<'_>, ProtocolError> {
    let mut r = Reader { bytes, at: 0 };
    let reply = match r.u8()? {
        BASE_KIND => Reply::Base(base::read(&mut r)?),
        130 => Reply::Resumed,
        131 => Reply::Splits(r.take(bytes.len() - 1)?),
        132 => Reply::Done,
        134 => {
            let text = String::from_utf8_lossy(r.take(bytes.len() - 1)?).into_owned();
            Reply::Catalogue(text.lines().take(CATALOGUE_LIMIT).map(Into::into).collect())
        }
        133 => Reply::Error(String::from_utf8_lossy(r.take(bytes.len() - 1)?).into_owned()),
        135 => Reply::Refused(String::from_utf8_lossy(r.take(bytes.len() - 1)?).into_owned()),
        _ => return r.error("no reply begins so"),
    };
    r.end(reply)
}

/// Reads a message.
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn error<T>(&self, what: &'static str) -> Result<T, ProtocolError> {
        Err(ProtocolError::Syntax { at: self.at.saturating_sub(1), what })
    }
    pub(crate) fn take(&mut self, count: usize) -> Result<&'a [u8], ProtocolError> {
        match self.bytes.get(self.at..self.at.saturating_add(count)) {
            Some(bytes) => {
                self.at += count;
                Ok(bytes)
            }
            None => Err(ProtocolError::Syntax { at: self.bytes.len(), what: "it ends too early" }),
        }
    }
    pub(crate) fn array<const N: usize>(&mut self) -> Result<[u8; N], ProtocolError> {
        let bytes = self.take(N)?;
        Ok(std::array::from_fn(|i| bytes[i]))
    }
    pub(crate) fn u8(&mut self) -> Result<u8, ProtocolError> {
        Ok(self.array::<1>()?[0])
    }
    /// All that is left.
    pub(crate) fn rest(&mut self) -> &'a [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        self.at = self.bytes.len();
        rest
    }
    pub(crate) fn f32(&mut self) -> Result<f32, ProtocolError> {
        Ok(f32::from_le_bytes(self.array()?))
    }
    fn end<T>(&self, value: T) -> Result<T, ProtocolError> {
        if self.at == self.bytes.len() {
            Ok(value)
        } else {
            Err(ProtocolError::Syntax { at: self.at, what: "bytes after its end" })
        }
    }
}
