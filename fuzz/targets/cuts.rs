//! The same bytes at once and in pieces: the same mesh, and an error in both or in neither. The first byte says how long pieces are.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pmesh_codec::Receiver;

fn received(bytes: &[u8], piece: usize) -> (bool, Receiver) {
    let mut receiver = Receiver::default();
    let pushed = bytes.chunks(piece).try_for_each(|piece| receiver.push(piece));
    let whole = pushed.and_then(|()| receiver.finish()).is_ok();
    (whole, receiver)
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&piece, bytes)) = bytes.split_first() else { return };
    let (one, at_once) = received(bytes, usize::MAX);
    let (other, in_pieces) = received(bytes, usize::from(piece) + 1);
    assert_eq!(one, other);
    let (a, b) = (at_once.mesh(), in_pieces.mesh());
    assert_eq!((a.arrived_levels(), a.level_count()), (b.arrived_levels(), b.level_count()));
    assert!(same(&at_once.mesh().finest_mesh(), &in_pieces.mesh().finest_mesh()));
});

/// The same bits: a float that is no number equals itself.
fn same(a: &pmesh_core::IndexedMesh, b: &pmesh_core::IndexedMesh) -> bool {
    let bits = |m: &pmesh_core::IndexedMesh| m.vertices.positions.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
    a.triangles == b.triangles && a.position_of == b.position_of && bits(a) == bits(b)
}
