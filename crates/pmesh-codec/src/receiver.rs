//! A decoder and the mesh that it grows: bytes in, levels out.

use crate::wavelet::{self, Picture, PictureDecoder};
use crate::{DecodeError, Decoder, Event, Place, StreamInfo, Texture};
use pmesh_core::{Change, IndexedMesh, ProgressiveMultilevelMesh};
use std::collections::VecDeque;
use std::sync::Arc;

/// What a push brought.
#[derive(Clone, Debug, PartialEq)]
pub enum Arrival {
    /// The stream's header.
    Info(StreamInfo),
    /// A part of a level was appended; corners that moved, for mirrors.
    Part(Change),
    /// A level is complete and can be shown.
    Level {
        /// 0 is the coarsest.
        step: u32,
        /// Bytes of the stream so far, whole pushes.
        bytes: u64,
        /// Corners that moved as the level ended.
        change: Change,
    },
    /// The base-colour image, or parts of it ([`wavelet::MIME`]).
    Texture(Texture),
    /// The picture that parts make is sharper than before: [`Receiver::picture`].
    Picture,
    /// Something is odd.
    Warning(String),
    /// The model is in other files, one after the other: URLs relative to this one's.
    Elsewhere(Vec<String>),
}

/// Grows a [`ProgressiveMultilevelMesh`] from bytes.
pub struct Receiver {
    decoder: Box<dyn Decoder + Send>,
    mesh: ProgressiveMultilevelMesh,
    info: Option<StreamInfo>,
    pictures: PictureDecoder,
    arrivals: VecDeque<Arrival>,
    bytes: u64,
    error: Option<DecodeError>,
}

impl Default for Receiver {
    fn default() -> Self {
        Self::new(crate::open())
    }
}

impl Receiver {
    /// Reads with `decoder`; [`Receiver::default`] sniffs.
    pub fn new(decoder: Box<dyn Decoder + Send>) -> Self {
        let mesh = ProgressiveMultilevelMesh::new(Default::default());
        Self { decoder, mesh, info: None, pictures: PictureDecoder::default(), arrivals: VecDeque::new(), bytes: 0, error: None }
    }
    /// The mesh so far.
    pub fn mesh(&self) -> &ProgressiveMultilevelMesh {
        &self.mesh
    }
    /// The mesh with all that can be shown of what has arrived: the finest whole level, and where the format allows it the part that is
    /// here of the next. Before the base is whole, nothing. O(n).
    pub fn newest_mesh(&self) -> IndexedMesh {
        if self.shows_part() { self.mesh.newest_mesh() } else { self.mesh.finest_mesh() }
    }
    /// True if [`Self::newest_mesh`] is finer than the finest whole level. Of a damaged level nothing is shown; one that was cut short is good as far
    /// as it goes.
    pub fn shows_part(&self) -> bool {
        let good = matches!(self.error, None | Some(DecodeError::Truncated { .. }));
        let allowed = self.info.as_ref().is_some_and(|i| i.shows_parts);
        allowed && good && self.mesh.arrived_levels() > 0 && self.mesh.has_open_level()
    }
    /// The mesh, to set its level.
    pub fn mesh_mut(&mut self) -> &mut ProgressiveMultilevelMesh {
        &mut self.mesh
    }
    /// The mesh, taken out.
    pub fn into_mesh(self) -> ProgressiveMultilevelMesh {
        self.mesh
    }
    /// The header, once it has arrived.
    pub fn info(&self) -> Option<&StreamInfo> {
        self.info.as_ref()
    }
    /// What the format's own paper counts, for people: (name, value).
    pub fn statistics(&self) -> Vec<(&'static str, String)> {
        self.decoder.statistics()
    }
    /// Bytes decoded so far by what they say, fractions counted: (component, bytes); empty where a format does not keep these apart.
    pub fn components(&self) -> Vec<(&'static str, f64)> {
        self.decoder.components()
    }
    /// The base-colour image as sharp as its parts make it, and how many times it was made; empty before.
    pub fn picture(&self) -> (&Arc<Picture>, u32) {
        self.pictures.picture()
    }
    /// Bytes pushed.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
    /// What has arrived since the last poll.
    pub fn poll(&mut self) -> Option<Arrival> {
        self.arrivals.pop_front()
    }

    /// Takes the next bytes and does all that there is to do with them. Levels complete before an error stay.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        self.feed(bytes)?;
        while self.work()? {}
        Ok(())
    }
    /// Does a small piece of what is left to do; false if nothing is.
    pub fn work(&mut self) -> Result<bool, DecodeError> {
        if self.error.is_some() {
            return Ok(false);
        }
        let worked = self.decoder.work();
        let more = worked.as_ref().is_ok_and(|&more| more);
        self.after(worked.map(drop))?;
        if more {
            return Ok(true);
        }
        let before = self.pictures.picture().1;
        let worked = self.pictures.work();
        if self.pictures.picture().1 > before {
            self.arrivals.push_back(Arrival::Picture);
        }
        let broken = |what| DecodeError::syntax(Place::Byte(self.bytes), format!("a part of the image: {what}"));
        let result = worked.map_err(broken);
        self.after(result.as_ref().map(drop).map_err(Clone::clone))?;
        result
    }
    /// Takes the next bytes; [`Self::work`] does the rest, in pieces.
    pub fn feed(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        if self.error.is_some() {
            return Err(DecodeError::Stopped);
        }
        self.bytes += bytes.len() as u64;
        let pushed = self.decoder.push(bytes);
        self.after(pushed)
    }
    /// Says that the stream has ended. What growing reserved is kept: giving it back copies everything, which a page would
    /// notice; [`ProgressiveMultilevelMesh::shrink_to_fit`] does it where memory counts more.
    pub fn finish(&mut self) -> Result<(), DecodeError> {
        if self.error.is_some() {
            return Err(DecodeError::Stopped);
        }
        while self.work()? {}
        let finished = self.decoder.finish();
        self.after(finished)
    }

    fn after(&mut self, result: Result<(), DecodeError>) -> Result<(), DecodeError> {
        let result = self.drain().and(result);
        if let Err(e) = &result {
            self.error = Some(e.clone());
        }
        result
    }

    fn drain(&mut self) -> Result<(), DecodeError> {
        while let Some(event) = self.decoder.poll() {
            let place = Place::Byte(self.bytes);
            let refused = |source| DecodeError::Mesh { place, source };
            let arrival = match event {
                Event::Info(info) => {
                    self.mesh = ProgressiveMultilevelMesh::new(info.attribute_set);
                    if let Some(count) = info.levels.as_ref().map(|l| l.len() as u32).or(info.level_count) {
                        self.mesh.declare_level_count(count);
                    }
                    self.info = Some(info.clone());
                    Arrival::Info(info)
                }
                Event::Part(part) => Arrival::Part(self.mesh.append(&part).map_err(refused)?),
                Event::LevelEnd => {
                    let change = self.mesh.complete_level().map_err(refused)?;
                    let table = self.info.as_ref().and_then(|i| i.levels.as_ref());
                    let levels = table.and_then(|t| t.get(self.mesh.arrived_levels() as usize).zip(t.last()));
                    if let Some((next, last)) = levels {
                        // All, or half of it, or a quarter: what is copied at the end is half as large then.
                        let room =
                            |all: u32, next: u32| (0..32).map(|k| all >> k).take_while(|&r| r >= next).last().unwrap_or(next);
                        let vertices = room(last.vertex_count, next.vertex_count);
                        self.mesh.reserve(vertices, room(last.triangle_count, next.triangle_count));
                    }
                    Arrival::Level { step: self.mesh.arrived_levels() - 1, bytes: self.bytes, change }
                }
                Event::Texture(texture) => {
                    if texture.mime == wavelet::MIME {
                        wavelet::parts(&texture.bytes).into_iter().for_each(|part| self.pictures.push(part));
                    }
                    Arrival::Texture(texture)
                }
                Event::Warning(text) => Arrival::Warning(text),
                Event::Elsewhere(urls) => Arrival::Elsewhere(urls),
            };
            self.arrivals.push_back(arrival);
        }
        Ok(())
    }
}
