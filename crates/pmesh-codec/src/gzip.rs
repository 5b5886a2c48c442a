//! Gzip around any other format (A.18: `horse.lod.gz`), inflated as it comes.

use crate::decoder::open_inside_gzip;
use crate::{DecodeError, Decoder, Event, Place};
use flate2::write::MultiGzDecoder;
use std::io::Write;

/// Input is inflated in slices of this many bytes, so that what one push can produce is bounded (deflate expands 1,032 times).
const SLICE_BYTES: usize = 1024;
/// Most inflated bytes a compressed one, over the whole stream. Text of meshes stays below 10.
const INFLATE_RATIO: u64 = 64;

/// Inflates and hands on.
pub struct GzipDecoder {
    inflate: MultiGzDecoder<Vec<u8>>,
    inner: Box<dyn Decoder + Send>,
    offset: u64,
    inflated: u64,
}

impl Default for GzipDecoder {
    fn default() -> Self {
        Self::new()
    }
}

impl GzipDecoder {
    /// A decoder that sniffs the format inside.
    pub fn new() -> Self {
        Self { inflate: MultiGzDecoder::new(Vec::new()), inner: open_inside_gzip(), offset: 0, inflated: 0 }
    }
    fn bad(&self, error: std::io::Error) -> DecodeError {
        DecodeError::syntax(Place::Byte(self.offset), format!("damaged gzip data ({error}): fetch the file again"))
    }
    fn hand_on(&mut self) -> Result<(), DecodeError> {
        let inflated = std::mem::take(self.inflate.get_mut());
        self.inflated += inflated.len() as u64;
        let limit = (self.offset + 4096) * INFLATE_RATIO;
        if self.inflated > limit {
            let place = Place::Byte(self.offset);
            return Err(DecodeError::Limit { place, what: "inflated data", got: self.inflated, limit });
        }
        self.inner.push(&inflated)
    }
}

impl Decoder for GzipDecoder {
    fn push(&mut self, bytes: &[u8]) -> Result<(), DecodeError> {
        for slice in bytes.chunks(SLICE_BYTES) {
            // Everything inflated before the damage is decoded first, so that where the input is cut does not matter.
            let written = self.inflate.write_all(slice).and_then(|()| self.inflate.flush());
            self.hand_on()?;
            written.map_err(|e| self.bad(e))?;
            self.offset += slice.len() as u64;
        }
        Ok(())
    }
    fn work(&mut self) -> Result<bool, DecodeError> {
        self.inner.work()
    }
    fn finish(&mut self) -> Result<(), DecodeError> {
        let ended = self.inflate.try_finish();
        self.hand_on()?;
        while self.inner.work()? {}
        let inside = self.inner.finish();
        match ended.map_err(|e| (e.kind(), self.bad(e))) {
            Ok(()) => inside,
            Err((std::io::ErrorKind::UnexpectedEof | std::io::ErrorKind::InvalidInput, _)) => {
                // What is inside knows how far it came; if it is whole, only gzip's own end is missing.
                inside.and(Err(DecodeError::Truncated { place: Place::Byte(self.offset), inside: "gzip data", levels: 0 }))
            }
            Err((_, bad)) => Err(bad),
        }
    }
    fn poll(&mut self) -> Option<Event> {
        self.inner.poll()
    }
    fn statistics(&self) -> Vec<(&'static str, String)> {
        self.inner.statistics()
    }
    fn components(&self) -> Vec<(&'static str, f64)> {
        self.inner.components()
    }
}
