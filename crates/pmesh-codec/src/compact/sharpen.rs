//! Coordinates of coarse levels lack their low bits; a finer level brings the next ones first.

use super::level::{LevelCoder, LevelModel};
use super::site::Memory;
use super::truth::LevelTruth;
use crate::range::{Chance, Coder};
use crate::refine::rows::Rows;

impl LevelModel {
    /// The next bit of each coordinate of `v`.
    fn sharpen(&mut self, coder: &mut impl Coder, memory: &mut Memory, rows: &mut Rows, v: u32, own: Option<&[i32]>) {
        let first = memory.first(v);
        let at = v as usize * rows.width;
        for k in 0..3 {
            rows.values[at + k] = if first < v {
                rows.value(first, k) as i32
            } else {
                let bit = coder.bit(&mut self.sharper[k], own.is_some_and(|o| o[k] >> rows.shift & 1 == 1));
                rows.values[at + k].wrapping_mul(2).wrapping_add(i32::from(bit))
            };
        }
        memory.sites[v as usize].edge *= 2.0;
    }
}

impl LevelCoder {
    /// The next bits of the positions that are there. All vertices have one before any has the next.
    pub(super) fn sharpen<C: Coder>(
        &mut self,
        coder: &mut C,
        (model, memory): (&mut LevelModel, &mut Memory),
        rows: &mut Rows,
        truth: Option<&LevelTruth>,
        limit: usize,
    ) -> Result<(), &'static str> {
        let first = coder.position();
        let stop = self.sharper.saturating_add(limit);
        while !self.is_sharp {
            if self.sharper < self.start {
                if self.sharper >= stop || !coder.has(self.reach) {
                    break;
                }
                let (v, before) = (self.sharper as u32, coder.byte_position());
                let own = truth.map(|t| t.rows.row(t.vertex_order[self.sharper]));
                model.sharpen(coder, memory, rows, v, own);
                self.read(coder, before)?;
                self.sharper += 1;
                continue;
            }
            if !coder.has(self.reach) {
                break;
            }
            let before = coder.byte_position();
            let more = rows.shift > 0 && coder.bit(&mut Chance::default(), truth.is_some_and(|t| t.shift < rows.shift));
            self.read(coder, before)?;
            if more {
                rows.shift -= 1;
                memory.mean_edge *= 2.0;
                (self.sharper, self.moved) = (0, self.start as u32);
            } else {
                // Told of once: a vertex moves once a level.
                rows.moved = self.moved;
                self.is_sharp = true;
            }
        }
        self.spent.sharper += coder.position() - first;
        Ok(())
    }
}
