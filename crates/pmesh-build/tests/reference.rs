//! The fast decoder against the reference decoder, which is written from docs/FORMAT-COMPACT.md alone.

mod common;
mod reference_decoder;

use common::{ground, soup};
use pmesh_build::import::link_seams;
use pmesh_build::sample::sample;
use pmesh_build::simplify::{BatchOptions, Profile, collapse_batches};
use pmesh_codec::Receiver;
use pmesh_codec::compact::{CompactStream, encode};
use pmesh_codec::pmesh::quantise;
use pmesh_core::IndexedMesh;
use proptest::prelude::*;
use reference_decoder::{Decoded, checksums, crc32, decode, decode_with};
use std::collections::BTreeSet;

fn data(name: &str) -> Vec<u8> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../pmesh-codec/tests/data").join(name);
    std::fs::read(path).expect("it is there")
}

fn encoded(mesh: &IndexedMesh, bits: Option<u8>, options: BatchOptions) -> Vec<u8> {
    let stream = CompactStream { mesh: mesh.clone(), ..collapse_batches(&quantise(mesh, bits), options, |_| ()) };
    let mut bytes = Vec::new();
    encode(&stream, bits, &mut bytes).expect("it encodes");
    bytes
}

fn bits_of<const N: usize>(values: &[[f32; N]]) -> Vec<u32> {
    values.as_flattened().iter().map(|x| x.to_bits()).collect()
}

/// Bit for bit, in the same order; seams as sets of pairs.
fn assert_same(reference: &Decoded, fast: &IndexedMesh, what: &str) {
    let attributes = &fast.vertices.attributes;
    assert_eq!(reference.positions.len(), fast.vertices.len(), "{what}: vertices");
    assert!(reference.triangles == fast.triangles, "{what}: triangles");
    assert!(bits_of(&reference.positions) == bits_of(&fast.vertices.positions), "{what}: positions");
    assert!(bits_of(&reference.normals) == bits_of(&attributes.normals), "{what}: normals");
    assert!(bits_of(&reference.colors) == bits_of(&attributes.colors), "{what}: colours");
    assert!(bits_of(&reference.texcoords) == bits_of(&attributes.texcoords), "{what}: texture coordinates");
    let set = |seams: &[(u32, u32)]| seams.iter().copied().collect::<BTreeSet<_>>();
    assert_eq!(set(&reference.seams), set(&fast.position_of), "{what}: seams");
    assert!(reference.representatives.iter().all(|(v, p)| p < v), "{what}: representatives");
}

/// The mesh after each block; gives the number of blocks.
fn agree_after_each_block(bytes: &[u8], what: &str) -> usize {
    let mut whole = Receiver::default();
    whole.push(bytes).and_then(|()| whole.finish()).expect("it decodes");
    let table = whole.info().and_then(|i| i.levels.clone()).expect("it has a table");
    let mut receiver = Receiver::default();
    let (mut at, mut block) = (0, 0);
    let end = decode_with(bytes, usize::MAX, |reference| {
        let what = format!("{what}, block {block} of {}", table.len());
        let end = table[block].end_byte as usize;
        receiver.push(&bytes[at..end]).expect("it decodes");
        (at, block) = (end, block + 1);
        assert_same(reference, &receiver.mesh().finest_mesh(), &what);
        assert_same(reference, &receiver.newest_mesh(), &what);
    });
    assert_same(&end.unwrap_or_else(|e| panic!("{what}: {e}")), &whole.newest_mesh(), what);
    assert_eq!(block, table.len(), "{what}");
    block
}

#[test]
fn golden_files_are_read_alike() {
    for name in ["version1-part.pmesh", "version1-globe.pmesh", "version1-exact.pmesh"] {
        println!("{name}: {} blocks", agree_after_each_block(&data(name), name));
    }
}

fn sample_is_read_alike(name: &str) {
    let mesh = sample(name).expect("it is built in").mesh;
    for (bits, profile) in [(Some(12), Profile::Prefix), (Some(16), Profile::Size), (None, Profile::Prefix)] {
        let bytes = encoded(&mesh, bits, BatchOptions { profile, ..Default::default() });
        let what = format!("{name} {bits:?} {profile:?}");
        println!("{what}: {} bytes, {} blocks", bytes.len(), agree_after_each_block(&bytes, &what));
    }
}

#[test]
fn the_marble_is_read_alike() {
    sample_is_read_alike("marble");
}

#[test]
fn the_tetrahedra_are_read_alike() {
    sample_is_read_alike("tetrahedra");
}

#[test]
fn the_knot_is_read_alike() {
    sample_is_read_alike("knot");
}

#[test]
fn the_part_is_read_alike() {
    sample_is_read_alike("part");
}

#[test]
fn the_globe_is_read_alike() {
    sample_is_read_alike("globe");
}

/// Fewer blocks give what there was after so many.
#[test]
fn some_blocks_are_what_they_are_of_all() {
    for name in ["version1-part.pmesh", "version1-globe.pmesh", "version1-exact.pmesh"] {
        let (bytes, mut block) = (data(name), 0);
        let all = decode_with(&bytes, usize::MAX, |reference| {
            block += 1;
            let some = decode(&bytes, block).expect("it decodes");
            assert_eq!(format!("{reference:?}"), format!("{some:?}"), "{name}, block {block}");
        });
        assert!(all.is_ok() && block > 2, "{name}: {block} blocks");
    }
}

/// Whether the fast decoder takes the whole file.
fn fast_takes(bytes: &[u8]) -> bool {
    let mut receiver = Receiver::default();
    receiver.push(bytes).and_then(|()| receiver.finish()).is_ok()
}

#[test]
fn damaged_files_are_refused_alike() {
    let bytes = data("version1-part.pmesh");
    assert!(fast_takes(&bytes) && decode(&bytes, usize::MAX).is_ok());
    let header = usize::from(bytes[9]) + 256 * usize::from(bytes[10]);
    for at in (0..header).chain((header..bytes.len()).step_by(37)) {
        for change in [0x01, 0x80] {
            let mut damaged = bytes.clone();
            damaged[at] ^= change;
            let (fast, slow) = (fast_takes(&damaged), decode(&damaged, usize::MAX));
            assert_eq!(fast, slow.is_ok(), "byte {at}: {:?}", slow.err());
            assert!(!fast, "byte {at} changed, and nobody noticed");
        }
    }
}

#[test]
fn files_cut_short_or_too_long_are_refused_alike() {
    let bytes = data("version1-part.pmesh");
    for length in (0..200).chain((200..bytes.len()).step_by(61)) {
        assert!(!fast_takes(&bytes[..length]) && decode(&bytes[..length], usize::MAX).is_err(), "{length} bytes");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(!fast_takes(&longer) && decode(&longer, usize::MAX).is_err());
}

/// Both decoders refuse, or both read the same; gives whether they read.
fn both_read(bytes: &[u8], what: &str) -> bool {
    let mut receiver = Receiver::default();
    let fast = receiver.push(bytes).and_then(|()| receiver.finish());
    let slow = decode(bytes, usize::MAX);
    assert_eq!(fast.is_ok(), slow.is_ok(), "{what}: fast {fast:?}, slow {:?}", slow.err());
    slow.map(|slow| assert_same(&slow, &receiver.newest_mesh(), what)).is_ok()
}

/// Changed bytes, under checksums that are right: both decoders refuse, or both read the same. Where `patient`, levels say that pieces may
/// be long, so that what they hold is read and not refused at once.
fn forged_is_read_alike(bytes: &[u8], changes: &[(usize, u8)], patient: bool, what: &str) -> bool {
    let (blocks, header) = checksums(bytes).expect("it is whole");
    let mut forged = bytes.to_vec();
    for &(at, change) in changes {
        forged[at] ^= change;
    }
    for &(_, start, _) in blocks.iter().skip(1).filter(|_| patient) {
        forged[start] |= 0x7f;
    }
    for (crc_at, start, end) in blocks {
        let crc = crc32(&forged[start..end]);
        forged[crc_at..crc_at + 2].copy_from_slice(&crc.to_le_bytes()[..2]);
    }
    let crc = crc32(&forged[..header - 4]);
    forged[header - 4..header].copy_from_slice(&crc.to_le_bytes());
    both_read(&forged, &format!("{what} {changes:?}"))
}

#[test]
fn forged_files_are_read_alike() {
    for name in ["version1-part.pmesh", "version1-globe.pmesh", "version1-exact.pmesh"] {
        let bytes = data(name);
        let (mut read, mut all) = (0, 0);
        for at in (11..bytes.len()).step_by(97) {
            for (change, patient) in [(0x01, false), (0x01, true), (0xff, true)] {
                read += usize::from(forged_is_read_alike(&bytes, &[(at, change)], patient, name));
                all += 1;
            }
        }
        println!("{name}: {read} of {all} forged files are read");
    }
}

/// A file of any blocks: (bytes, vertices, triangles), under a header that is right.
fn file_of(flags: u8, bits: u8, blocks: &[(Vec<u8>, u8, u8)]) -> Vec<u8> {
    let mut out = vec![0x89, 0x50, 0x4d, 0x53, 0x48, 0x0d, 0x0a, 0x1a, 1, 0, 0, flags, bits];
    out.extend(std::iter::repeat_n(8, (flags & 7).count_ones() as usize));
    out.extend([0; 4]);
    if bits > 0 {
        out.push(3);
        [0.5f32, -7.0, 100.0].iter().for_each(|x| out.extend(x.to_le_bytes()));
        out.extend(0.01f64.to_le_bytes());
        out.extend([100, 100, 100]);
    } else {
        out.extend([0; 24]);
    }
    if flags & 4 != 0 {
        [0.0f32, 0.0].iter().for_each(|x| out.extend(x.to_le_bytes()));
        out.extend(0.01f64.to_le_bytes());
    }
    out.push(blocks.len() as u8);
    for (bytes, nv, nt) in blocks {
        let (d, crc) = (2 * i32::from(*nv) - i32::from(*nt), crc32(bytes).to_le_bytes());
        let zigzag = if d < 0 { -2 * d - 1 } else { 2 * d };
        let varint = |x: usize| [x as u8 | 0x80, (x >> 7) as u8];
        out.extend(varint(bytes.len()));
        out.extend([0, crc[0], crc[1]]);
        out.extend(varint((*nv).into()));
        out.extend(varint(zigzag as usize));
        out.extend([0, 0]);
    }
    let length = (out.len() + 4) as u16;
    out[9..11].copy_from_slice(&length.to_le_bytes());
    out.extend(crc32(&out).to_le_bytes());
    blocks.iter().for_each(|b| out.extend(&b.0));
    out
}

/// A mesh of two colours: where triangles of both meet there is a seam.
fn in_two_colours(mesh: &IndexedMesh, of: &[bool]) -> IndexedMesh {
    let n = mesh.vertices.len();
    let mut out = mesh.clone();
    out.vertices.extend_from(&mesh.vertices);
    out.vertices.attributes.colors = [[0.25, 0.5, 0.75, 1.0], [1.0, 0.0, 0.5, 1.0]].iter().flat_map(|c| vec![*c; n]).collect();
    for (t, second) in out.triangles.iter_mut().zip(of.iter().cycle()) {
        if *second {
            *t = t.map(|v| v + n as u32);
        }
    }
    out.position_of.clear();
    link_seams(&mut out);
    out
}

/// A level without vertices on a base without any: whoever makes room for it must not look for ever for how much.
#[test]
fn levels_of_nothing_end() {
    for bits in [0, 12] {
        let nothing = || (vec![0x7f; 60], 0, 0);
        both_read(&file_of(0, bits, &[nothing(), nothing(), nothing(), (vec![0x7f; 60], 3, 6)]), "nothing");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// A base, and loose vertices, of any bytes.
    #[test]
    fn any_base_is_read_alike(
        flags in 0u8..16, bits in prop::sample::select(vec![0u8, 12]), nv in 3u8..30, nt in 0u8..8,
        base in prop::collection::vec(any::<u8>(), 100..800), loose in prop::collection::vec(any::<u8>(), 100..300),
    ) {
        both_read(&file_of(flags, bits, &[(base, nv, nt), (loose, 5, 0)]), "any base");
    }

    /// Levels of any bytes on a base that is right: surfaces that no mesh has, places anywhere, triangles that have a vertex twice.
    #[test]
    fn any_levels_are_read_alike(
        mesh in prop_oneof![soup(), ground()], colours in prop::collection::vec(any::<bool>(), 1..40), two: bool,
        bits in prop::sample::select(vec![None, Some(12)]),
        levels in prop::collection::vec((prop::collection::vec(any::<u8>(), 60..400), 0u8..9), 0..5),
    ) {
        let mesh = if two { in_two_colours(&mesh, &colours) } else { mesh };
        let source = encoded(&mesh, bits, BatchOptions { base_vertices: 4, profile: Profile::Prefix });
        let base = decode(&source, 1).expect("it is whole");
        let (_, start, end) = checksums(&source).expect("it is whole").0[0];
        let mut blocks = vec![(source[start..end].to_vec(), base.positions.len() as u8, base.triangles.len() as u8)];
        for (mut bytes, nv) in levels {
            bytes[0] = 0x7f;
            blocks.push((bytes, nv, 2 * nv));
        }
        both_read(&file_of(source[11], bits.unwrap_or(0), &blocks), "any levels");
    }

    #[test]
    fn any_soup_is_read_alike(mesh in soup()) {
        for bits in [Some(12), None] {
            let bytes = encoded(&mesh, bits, BatchOptions { base_vertices: 4, profile: Profile::Prefix });
            agree_after_each_block(&bytes, "soup");
        }
    }

    #[test]
    fn any_ground_is_read_alike(mesh in ground(), colours in prop::collection::vec(any::<bool>(), 1..40), size: bool) {
        let profile = if size { Profile::Size } else { Profile::Prefix };
        for mesh in [&mesh, &in_two_colours(&mesh, &colours)] {
            for bits in [Some(12), None] {
                agree_after_each_block(&encoded(mesh, bits, BatchOptions { base_vertices: 4, profile }), "ground");
            }
        }
    }
}
