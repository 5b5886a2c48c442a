//! A client of a file: which bytes a view needs, and what they bring. Any server that answers range requests will do.

use crate::blocks::{BlockModels, code_block};
use crate::error::ProtocolError;
use crate::file::{Block, Head};
use crate::pack::first_roots;
use crate::patch::{Local, Patch, Place};
use crate::sides::Side;
use crate::viewer::{Limits, SPLIT_BYTES, SPLITS_A_BYTE, Viewer};
use pmesh_codec::range::RangeDecoder;
use pmesh_core::hierarchy::{Bounds, NONE, NodeId, Progress, Split, View};

/// Bytes of the first request: a base mesh, and often the first blocks.
const FIRST_BYTES: u64 = 16 << 10;
/// Bytes of a request, beyond which blocks that lie side by side are asked for apart.
const REQUEST_BYTES: u64 = 64 << 10;
/// Most nodes and triangles that blocks begin with, and how many more for each byte: real ones have some two.
const WORK_LIMIT: u64 = 1 << 18;
const WORK_A_BYTE: u64 = 1 << 4;
/// Looks at nodes that unpacking a block counts as: both take a millisecond or so.
const LOOKS_A_BLOCK: u32 = 1 << 9;
/// Requests at a time.
const REQUESTS: usize = 6;

/// A block that is known, perhaps by no more than its place.
#[derive(Clone, Debug)]
struct Known {
    block: Block,
    /// The block above, or [`NONE`].
    above: u32,
    /// The first block below it, once it has been unpacked: others below it follow; [`NONE`] before.
    child: u32,
    children: u32,
    /// What it is told by, once the block above it is here.
    patch: Option<Patch>,
    /// Its bytes.
    bytes: Option<Vec<u8>>,
    state: State,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Not here, and not needed.
    Away,
    Wanted,
    UnderWay,
    /// All of its splits are known.
    Here,
}

impl Known {
    fn new(block: Block, above: u32) -> Self {
        Self { block, above, child: NONE, children: 0, patch: None, bytes: None, state: State::Away }
    }
}

/// A model that arrives from a file as it is looked at. [`Self::poll`] gives ranges of bytes to be fetched, several at a time; [`Self::receive`] takes them.
#[derive(Debug, Default)]
pub struct FileClient {
    viewer: Viewer,
    /// The file's beginning, as much as came at once.
    beginning: Vec<u8>,
    needed: u64,
    /// Those that are known, in the order in which they were met.
    blocks: Vec<Known>,
    /// Of each split that is known.
    block_of: Vec<u32>,
    /// Of each node without children here the block that has its split; of others it means nothing.
    entry: Vec<u32>,
    /// First bytes of what is under way, and its blocks.
    under_way: Vec<(u64, Vec<u32>)>,
    view: Option<View>,
    /// What the first block has taught.
    prior: Option<BlockModels>,
    /// Nodes looked at since something was loaded.
    looked: usize,
    /// Sizes of all patches, bytes of the blocks that they came with, and of those that are kept.
    work: u64,
    unpacked: u64,
    kept: u64,
    /// Most splits of a block beside the first.
    largest: u32,
    /// Most blocks one above the other.
    deepest: usize,
    bytes: u64,
    requests: u64,
}

impl FileClient {
    /// As of [`crate::Client::draw`].
    pub fn draw(mut self) -> Self {
        self.viewer.is_drawn = true;
        self
    }
    /// The next bytes to be fetched: from the first up to, not including, the second.
    pub fn poll(&mut self) -> Option<(u64, u64)> {
        if self.viewer.is_empty() {
            let start = self.beginning.len() as u64;
            let end = self.needed.max(FIRST_BYTES);
            let is_new = self.under_way.is_empty() && start < end;
            return is_new.then(|| {
                self.under_way.push((start, Vec::new()));
                self.requests += 1;
                (start, end)
            });
        }
        if self.under_way.len() >= REQUESTS {
            return None;
        }
        let mut wanted: Vec<(u64, u32)> = (0..self.block_count())
            .filter(|&b| self.blocks[b as usize].state == State::Wanted)
            .map(|b| (self.place(b).0, b))
            .collect();
        wanted.sort_unstable();
        let start = wanted.first()?.0;
        let (mut end, mut run) = (start, Vec::new());
        for (from, b) in wanted {
            if from != end || end - start >= REQUEST_BYTES {
                break;
            }
            end += u64::from(self.place(b).1);
            self.blocks[b as usize].state = State::UnderWay;
            run.push(b);
        }
        self.under_way.push((start, run));
        self.requests += 1;
        Some((start, end))
    }
    /// Takes bytes of the file from `start` on: what was asked for, or more. Errors: a damaged file, or another one by now: nothing more comes of it then.
    pub fn receive(&mut self, start: u64, bytes: &[u8]) -> Result<(), ProtocolError> {
        self.bytes += bytes.len() as u64;
        let asked = self.answered(start);
        if self.viewer.is_empty() {
            if start != self.beginning.len() as u64 {
                return Err(ProtocolError::Unexpected("bytes that nobody asked for"));
            }
            if bytes.is_empty() {
                return Err(ProtocolError::Syntax { at: self.beginning.len(), what: "the file ends too early" });
            }
            self.beginning.extend(bytes);
            return self.begin();
        }
        for b in asked {
            let (from, length) = self.place(b);
            let from = (from - start) as usize;
            let Some(block) = bytes.get(from..from.saturating_add(length as usize)) else {
                return Err(ProtocolError::Syntax {
                    at: (start as usize).saturating_add(bytes.len()),
                    what: "the file ends too early",
                });
            };
            self.keep(b, block);
            // It is unpacked when the front wants it.
            self.blocks[b as usize].state = State::Away;
        }
        Ok(())
    }
    /// Bytes that were asked for do not come: they are asked for again.
    pub fn failed(&mut self, start: u64) {
        let again = self.answered(start);
        again.into_iter().for_each(|b| self.blocks[b as usize].state = State::Wanted);
    }
    fn answered(&mut self, start: u64) -> Vec<u32> {
        let at = self.under_way.iter().position(|(from, _)| *from == start);
        at.map_or(Vec::new(), |at| self.under_way.swap_remove(at).1)
    }

    fn begin(&mut self) -> Result<(), ProtocolError> {
        let head = match Head::read(&self.beginning)? {
            Ok(head) => head,
            Err(needed) => {
                self.needed = needed;
                return Ok(());
            }
        };
        let roots = first_roots(&head.base.positions, &head.base.bounds, head.base.extent);
        if head.first.map_or(0, |b| b.roots as usize) != roots.len() {
            return Err(ProtocolError::Unexpected("a first block of other roots than the base mesh has"));
        }
        let base = &head.base;
        let place = |i: u32| {
            let (p, bounds) = (base.positions[i as usize], base.bounds[i as usize]);
            Place { id: NodeId::root(i), row: base.grid.position_row(p), bounds }
        };
        let patch = Patch::of_base(roots, (base.positions.len() as u32, &base.triangles), place);
        self.viewer.begin(head.base)?;
        self.blocks.extend(head.first.map(|block| Known::new(block, NONE)));
        if head.first.is_some() {
            self.begin_at(0, patch);
            self.take_early(0);
        }
        Ok(())
    }
    /// A block may have come along with the beginning.
    fn take_early(&mut self, b: u32) {
        let (start, length) = self.place(b);
        let Ok(from) = usize::try_from(start) else { return };
        if let Some(bytes) = self.beginning.get(from..from.saturating_add(length as usize)) {
            let bytes = bytes.to_vec();
            self.keep(b, &bytes);
        }
    }
    /// Block `b` begins there.
    fn begin_at(&mut self, b: u32, patch: Patch) {
        for &i in &patch.roots {
            // A root that the block does not split is one of a block below it, too, which may be here already.
            let before = self.entry.get(i as usize).copied().filter(|&e| e != NONE);
            if before.is_none_or(|e| self.chain(e).all(|above| above != b)) {
                self.enter(i, b);
            }
        }
        self.viewer.beside += patch.memory_bytes();
        let before = self.blocks[b as usize].patch.replace(patch);
        self.viewer.beside -= before.map_or(0, |p| p.memory_bytes());
    }
    /// The way to a cut ends there for now. Where a block that goes on with it was here before the one that says so, it must say its part again.
    fn ends_at(&mut self, cut: NodeId) {
        let front = &self.viewer.front;
        let Some((at, node)) = front.find(cut).and_then(|i| Some((i, front.node(i)?))) else { return };
        let split = node.child.checked_sub(front.root_count()).filter(|_| node.child != NONE);
        if let Some(&b) = split.and_then(|s| self.block_of.get(s as usize / 2)) {
            self.leave(b);
            self.enter(at, b);
        }
    }
    /// A block is needed again: if nobody knows where it begins, the one above it, too.
    fn leave(&mut self, b: u32) {
        let mut at = b;
        while at != NONE {
            let Known { state, patch, above, .. } = &mut self.blocks[at as usize];
            if *state == State::Here {
                *state = State::Away;
            }
            at = if patch.is_some() { NONE } else { *above };
        }
    }
    fn enter(&mut self, node: u32, b: u32) {
        self.entry.resize(self.entry.len().max(node as usize + 1), NONE);
        self.entry[node as usize] = b;
    }
    /// First byte and length of a block.
    pub(crate) fn place(&self, b: u32) -> (u64, u32) {
        let block = self.blocks[b as usize].block;
        (block.start, block.length)
    }
    /// Keeps the bytes of a block: for when they are needed, and needed again.
    pub(crate) fn keep(&mut self, b: u32, bytes: &[u8]) {
        let all = self.kept + bytes.len() as u64;
        // Blocks do not lie over each other: there are no more bytes of them than came.
        if self.blocks[b as usize].bytes.is_none() && all <= self.bytes {
            self.kept = all;
            self.viewer.beside += bytes.len();
            self.blocks[b as usize].bytes = Some(bytes.to_vec());
        }
    }

    /// Unpacks a block whose bytes are here; false if they are not, or nobody knows where it begins. Errors: a damaged file.
    pub(crate) fn load(&mut self, b: u32) -> Result<bool, ProtocolError> {
        if self.blocks[b as usize].state == State::Here {
            return Ok(true);
        }
        let Known { block, child, children, patch: Some(patch), bytes: Some(bytes), .. } = &self.blocks[b as usize] else {
            return Ok(false);
        };
        let (block, child, children) = (*block, *child, *children);
        let (below, bytes) = block.open(bytes)?;
        // When it comes again it must be what it was.
        let same = child as usize..(child as usize).saturating_add(below.len());
        if child != NONE
            && (below.len() != children as usize || !self.blocks[same].iter().map(|k| k.block).eq(below.iter().copied()))
        {
            return Err(ProtocolError::Damaged { at: block.start });
        }
        if child == NONE {
            self.unpacked += u64::from(block.length);
            if self.unpacked > self.bytes {
                return Err(ProtocolError::Unexpected("blocks that lie over each other"));
            }
        }
        let v = &mut self.viewer;
        let front = &v.front;
        let place = |i: u32| {
            let node = front.node(i);
            let (position, bounds) = node.map_or(([0.0; 3], Bounds::default()), |n| (n.position, n.bounds));
            Place { id: front.id(i), row: v.grid.position_row(position), bounds }
        };
        let mut local = Local::new(patch, (&v.grid, front.unit()), place)?;
        let mut coder = RangeDecoder::new(bytes.to_vec());
        let mut models = self.prior.clone().filter(|_| b != 0).unwrap_or_default();
        let told = code_block(&mut coder, &mut models, &mut local, block.splits)?;
        if b == 0 {
            self.prior = Some(models);
        }
        let mut open: Vec<NodeId> = told.longer.iter().map(|l| l.2).collect();
        for (s, cuts) in told.cuts.into_iter().enumerate() {
            let node = local.splits()[s].node;
            let parent = local.number(node);
            // A part of a block may be here already.
            let child = match v.front.node(parent).map_or(NONE, |n| n.child) {
                NONE => {
                    let (child, second) = (v.front.known() as u32, local.child_of(node));
                    if u64::from(child) + 2 > v.total {
                        return Err(ProtocolError::Unexpected("more nodes than the base mesh announces"));
                    }
                    let bounds = [second, second + 1].map(|c| local.bounds(c));
                    let position = v.grid.position_of_row(local.row(second + 1));
                    v.front.learn(&Split { id: local.id(node), cuts, position, bounds })?;
                    self.block_of.push(b);
                    v.splits += 1;
                    open.extend(cuts.into_iter().flatten());
                    child
                }
                child => child,
            };
            local.set_number(local.child_of(node), child);
        }
        for (split, k, cut) in told.longer {
            v.front.lengthen_cut(split, k, cut);
        }
        // The same bytes may be named again and again, and grow without end.
        if self.block_of.len() as u64 > SPLITS_A_BYTE * self.bytes {
            return Err(ProtocolError::Unexpected("more splits than its bytes can hold"));
        }
        let mut ends = local.ends();
        if below.iter().map(|c| u64::from(c.roots)).sum::<u64>() != ends.len() as u64 {
            return Err(ProtocolError::Unexpected("blocks below one of other roots than it ends at"));
        }
        let roots = |blocks: &[Block]| blocks.iter().map(|c| c.roots as usize).sum();
        local.divide(&mut ends, 0..below.len(), &mut |_, parts| roots(&below[parts.start..parts.start + parts.len() / 2]));
        let mut patches = Vec::with_capacity(below.len());
        let mut ends = &ends[..];
        for block in &below {
            let (run, others) = ends.split_at(block.roots as usize);
            let patch = local.patch(run);
            // The first time, that is: what is unpacked again has been counted.
            if child == NONE {
                self.work += patch.size() as u64;
                if self.work > WORK_LIMIT + WORK_A_BYTE * self.bytes {
                    return Err(ProtocolError::Unexpected("blocks that begin with more than their bytes are worth"));
                }
            }
            patches.push(patch);
            ends = others;
        }
        let first = if child == NONE { self.blocks.len() as u32 } else { child };
        if child == NONE {
            (self.blocks[b as usize].child, self.blocks[b as usize].children) = (first, below.len() as u32);
            self.blocks.extend(below.iter().map(|&block| Known::new(block, b)));
            self.largest = below.iter().map(|c| c.splits).fold(self.largest, u32::max);
            (first..first + below.len() as u32).for_each(|c| self.take_early(c));
        }
        for (c, patch) in (first..).zip(patches) {
            // One that is here knows where it begins, and what begins at its ends.
            let known = &self.blocks[c as usize];
            if known.state != State::Here || known.patch.is_none() {
                self.begin_at(c, patch);
            }
        }
        open.into_iter().for_each(|cut| self.ends_at(cut));
        self.blocks[b as usize].state = State::Here;
        self.deepest = self.deepest.max(self.chain(b).count() + 1);
        Ok(true)
    }
    /// A block and those above it.
    fn chain(&self, b: u32) -> impl Iterator<Item = u32> {
        std::iter::successors(Some(b), |&b| Some(self.blocks[b as usize].above).filter(|&a| a != NONE))
    }

    /// Follows a view, with at most `budget` looks at nodes: refines what is here, and wants what is not. Keeps the limits. Errors: what arrived is no hierarchy.
    pub fn refine(&mut self, view: &View, budget: u32) -> Result<Progress, ProtocolError> {
        let (view, progress) = self.viewer.refine(view, budget)?;
        if self.view.is_none_or(|v| v != view) {
            self.view = Some(view);
            self.blocks.iter_mut().filter(|b| b.state == State::Wanted).for_each(|b| b.state = State::Away);
        }
        self.looked = self.looked.saturating_add(progress.looked as usize);
        // What was loaded stays until the front has had its chance to split there.
        let is_new = self.is_waiting() || self.looked < self.viewer.front.len();
        let first = self.blocks.first().map_or(0, |b| b.block.splits);
        let on_the_way = (self.deepest * self.largest as usize + first as usize) * 2 * SPLIT_BYTES;
        if self.viewer.is_over(if is_new { on_the_way } else { 0 }) {
            self.forget();
        }
        let entered = |&node: &u32| self.entry.get(node as usize).copied().filter(|&b| b != NONE);
        let mut targets: Vec<u32> = self.viewer.front.take_wanted().iter().filter_map(entered).collect();
        targets.sort_unstable();
        targets.dedup();
        let most = (budget / LOOKS_A_BLOCK).max(1);
        let mut unpacked = 0;
        for target in targets {
            unpacked += self.approach(target, unpacked < most)?;
            // Where memory is short, one at a time.
            if unpacked > 0 && self.viewer.is_over(0) {
                break;
            }
        }
        Ok(progress)
    }
    /// Unpacks a block, and what is missing above it, if that is allowed and their bytes are here; wants the first whose bytes are not. Gives how many were unpacked.
    fn approach(&mut self, target: u32, may_unpack: bool) -> Result<u32, ProtocolError> {
        let mut unpacked = 0;
        // Where something was forgotten, the nearest block above that is known to begin somewhere.
        loop {
            let Some(b) = self.chain(target).find(|&b| self.blocks[b as usize].patch.is_some()) else { break };
            let block = &mut self.blocks[b as usize];
            match (block.state, block.bytes.is_some()) {
                (State::Away, false) => block.state = State::Wanted,
                (State::Wanted | State::UnderWay, false) | (State::Here, _) => break,
                _ if !may_unpack || !self.load(b)? => break,
                _ => {
                    unpacked += 1;
                    self.looked = 0;
                }
            }
        }
        Ok(unpacked)
    }
    fn forget(&mut self) {
        let front = &mut self.viewer.front;
        let roots = front.root_count();
        let parents: Vec<u32> =
            (0..self.block_of.len() as u32).map(|n| front.node(roots + 2 * n).map_or(NONE, |k| k.parent)).collect();
        let number = front.forget_below();
        let node = |i: u32| match i.checked_sub(roots) {
            None => Some(i),
            Some(below) => number.get(below as usize / 2).copied().flatten().map(|n| roots + 2 * n + below % 2),
        };
        let before = std::mem::take(&mut self.entry);
        for (i, &b) in before.iter().enumerate().filter(|(_, b)| **b != NONE) {
            node(i as u32).into_iter().for_each(|i| self.enter(i, b));
        }
        for (n, &b) in self.block_of.iter().enumerate().filter(|(n, _)| number[*n].is_none()) {
            let block = &mut self.blocks[b as usize];
            if block.state == State::Here {
                block.state = State::Away;
            }
            if let Some(parent) = node(parents[n]) {
                self.entry.resize(self.entry.len().max(parent as usize + 1), NONE);
                self.entry[parent as usize] = b;
            }
        }
        self.block_of = self.block_of.iter().zip(&number).filter(|(_, n)| n.is_some()).map(|(b, _)| *b).collect();
        for block in &mut self.blocks {
            let patch = block.patch.take();
            block.patch = patch.and_then(|p| p.renamed(node));
        }
        // Bytes are some fiftieth of what they become: they stay, unless even they are too many. The first block is above all.
        let kept = |blocks: &[Known]| blocks.iter().flat_map(|b| &b.bytes).map(Vec::len).sum::<usize>();
        if kept(&self.blocks) > self.viewer.limits().memory / 4 {
            self.blocks.iter_mut().skip(1).for_each(|b| b.bytes = None);
        }
        self.kept = kept(&self.blocks) as u64;
        self.viewer.beside =
            self.kept as usize + self.blocks.iter().flat_map(|b| &b.patch).map(Patch::memory_bytes).sum::<usize>();
        let away: Vec<u32> = (0..self.block_count()).filter(|&b| self.blocks[b as usize].state != State::Here).collect();
        away.into_iter().for_each(|b| self.leave(b));
        self.viewer.evictions += 1;
    }
    /// What the client may take from now on.
    pub fn set_limits(&mut self, limits: Limits) {
        self.viewer.set_limits(limits);
    }

    /// Blocks that are known so far.
    pub(crate) fn block_count(&self) -> u32 {
        self.blocks.len() as u32
    }
    /// True if something is to come: fetched, or to be fetched.
    pub fn is_waiting(&self) -> bool {
        self.viewer.is_empty() || !self.under_way.is_empty() || self.blocks.iter().any(|b| b.state == State::Wanted)
    }
    /// What is here.
    pub fn viewer(&self) -> &Viewer {
        &self.viewer
    }
    /// The same, for who draws it.
    pub fn viewer_mut(&mut self) -> &mut Viewer {
        &mut self.viewer
    }
    /// Requests made, and bytes received.
    pub fn traffic(&self) -> (u64, u64) {
        (self.requests, self.bytes)
    }
}
