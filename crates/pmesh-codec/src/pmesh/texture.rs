//! The base-colour image among the levels: a PNG or JPEG file in one block, or the parts of a wavelet picture between levels.

use super::BLOCK_LIMIT;
use super::header::{Block, BlockKind};
use crate::{DecodeError, EncodeError, Place, Texture, wavelet};

fn block(kind: BlockKind, payload: &[u8]) -> Block {
    let (byte_count, checksum) = (payload.len() as u32, crc32fast::hash(payload));
    Block { kind, byte_count, checksum, new_vertices: 0, new_triangles: 0, error: 0.0 }
}

/// Puts the image between the levels whose `blocks` and `payloads` are given.
pub(crate) fn insert(texture: &Texture, blocks: &mut Vec<Block>, payloads: &mut Vec<Vec<u8>>) -> Result<(), EncodeError> {
    let code = match texture.mime.as_str() {
        "image/png" => 0,
        "image/jpeg" => 1,
        wavelet::MIME => return insert_parts(&texture.bytes, blocks, payloads),
        _ => {
            let expected = "image/png, image/jpeg, or parts of a wavelet picture";
            return Err(EncodeError::BadOption { what: "the texture's type", got: texture.mime.clone(), expected });
        }
    };
    // Before the first level that is larger than it, and not before the first picture.
    let larger = payloads.iter().position(|p| p.len() > texture.bytes.len() / 2);
    let at = larger.unwrap_or(payloads.len()).max(1);
    let payload = [&[code], &texture.bytes[..]].concat();
    blocks.insert(at, block(BlockKind::Texture, &payload));
    payloads.insert(at, payload);
    Ok(())
}

/// How much faster an image comes than the levels do, as shares of their bytes: a sharp picture on a coarse shape is worth more
/// than the other way round.
const AHEAD: usize = 3;

/// Parts and levels side by side: the first part comes behind the first level, another once the levels have brought a third as great a
/// share of their bytes as the parts before it, and as many bytes as they and it: where levels are small the shape would wait for the
/// image.
fn insert_parts(framed: &[u8], blocks: &mut Vec<Block>, payloads: &mut Vec<Vec<u8>>) -> Result<(), EncodeError> {
    let parts = wavelet::parts(framed);
    let room = BLOCK_LIMIT.saturating_sub(blocks.len());
    if room == 0 || parts.is_empty() {
        let expected = "at most 63 levels beside an image: merge levels first";
        return Err(EncodeError::BadOption { what: "the number of levels", got: blocks.len().to_string(), expected });
    }
    // Where the table has no room for all, the last ones go together.
    let mut groups: Vec<Vec<u8>> = parts.into_iter().map(wavelet::framed).collect();
    while groups.len() > room {
        let last = groups.pop().unwrap_or_default();
        if let Some(before) = groups.last_mut() {
            before.extend(last);
        }
    }
    let (levels, all_parts) = (payloads.iter().map(Vec::len).sum::<usize>(), groups.iter().map(Vec::len).sum::<usize>());
    let (mut level_bytes, mut part_bytes) = (0, 0);
    let mut groups = groups.into_iter().peekable();
    let old = std::mem::take(payloads).into_iter().zip(std::mem::take(blocks));
    for (payload, block_of_level) in old {
        level_bytes += payload.len();
        payloads.push(payload);
        blocks.push(block_of_level);
        let in_share = |part_bytes: usize| part_bytes * levels <= AHEAD * level_bytes * all_parts;
        let in_bytes = |all: usize| all <= level_bytes || level_bytes == levels;
        while let Some(group) = groups.next_if(|g| part_bytes == 0 || in_share(part_bytes) && in_bytes(part_bytes + g.len())) {
            part_bytes += group.len();
            blocks.push(block(BlockKind::Picture, &group));
            payloads.push(group);
        }
    }
    Ok(())
}

/// The image of a block.
pub(crate) fn texture_of(kind: BlockKind, mut block: Vec<u8>, place: Place) -> Result<Texture, DecodeError> {
    if kind == BlockKind::Picture {
        return Ok(Texture { mime: wavelet::MIME.into(), bytes: block });
    }
    let mime = match block.first() {
        Some(0) => "image/png",
        Some(1) => "image/jpeg",
        _ => return Err(DecodeError::syntax(place, "the texture is neither PNG nor JPEG")),
    };
    Ok(Texture { mime: mime.into(), bytes: block.split_off(1) })
}
