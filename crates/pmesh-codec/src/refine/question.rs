//! A yes or no that several contexts know something of.

use crate::range::{Chance, Coder, INPUTS, Mixer};

/// Values of a context: sizes of patches, valences and areas are told apart up to there.
pub(crate) const CLASSES: usize = 8;
/// Three classes make a context.
const CONTEXTS: usize = CLASSES * CLASSES * CLASSES;

/// Chances of a yes or no by six contexts, mixed.
pub(crate) struct Question {
    mixers: [Mixer; CLASSES],
    /// By context, for each input of the mixer.
    chances: [Vec<Chance>; INPUTS],
}

impl Question {
    pub(crate) fn new() -> Self {
        let chances = std::array::from_fn(|_| vec![Chance::default(); CONTEXTS]);
        Self { mixers: std::array::from_fn(|_| Mixer::default()), chances }
    }
    /// Each context is three classes below [`CLASSES`]; `weights` chooses the mixer.
    pub(crate) fn code(&mut self, coder: &mut impl Coder, weights: usize, contexts: [[usize; 3]; INPUTS], bit: bool) -> bool {
        let index = |[a, b, c]: [usize; 3]| (a.min(CLASSES - 1) * CLASSES + b.min(CLASSES - 1)) * CLASSES + c.min(CLASSES - 1);
        let mut at = contexts.into_iter().map(index);
        let chances = self.chances.each_mut().map(|part| &mut part[at.next().unwrap_or(0)]);
        coder.mixed(&mut self.mixers[weights.min(CLASSES - 1)], chances, bit)
    }
}
