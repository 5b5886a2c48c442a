//! What a new vertex brings: whose position it shares, where it stands, its attributes.

use super::center::Side;
use super::level::{LevelCoder, LevelModel};
use super::place::P;
use super::site::{Memory, Site};
use super::truth::LevelTruth;
use crate::range::Coder;
use crate::refine::rows::Rows;
use pmesh_core::surface::{NONE, Surface, next, previous};

/// A new vertex of the boundary.
pub(super) struct Fresh {
    pub(super) vertex: u32,
    pub(super) from: u32,
    pub(super) side: Side,
    /// How many share its position.
    pub(super) shared: u32,
}

impl LevelCoder {
    /// Codes which new vertex `v` shares its position with, if any.
    pub(super) fn link(
        &mut self,
        coder: &mut impl Coder,
        model: &mut LevelModel,
        memory: &Memory,
        (p, v, side): (u32, u32, Side),
        truth: Option<&LevelTruth>,
        own: Option<u32>,
    ) -> Result<Option<u32>, &'static str> {
        let list = self.fresh.entry(memory.first(p)).or_default();
        let mut found = None;
        if !list.is_empty() {
            let place = |t: &LevelTruth, v: u32| if t.position_of[v as usize] == NONE { v } else { t.position_of[v as usize] };
            let same =
                |f: &Fresh| truth.zip(own).is_some_and(|(t, o)| place(t, t.vertex_order[f.vertex as usize]) == place(t, o));
            let wanted = list.iter().rev().position(same).map_or(0, |i| i + 1);
            let n = coder.number(&mut model.link[list.len().min(4) - 1], wanted as u32) as usize;
            if n > list.len() {
                return Err("a seam to a vertex that is not there");
            }
            found = n.checked_sub(1).map(|i| list[list.len() - 1 - i].vertex);
        }
        for f in list.iter_mut().filter(|f| Some(f.vertex) == found) {
            f.shared += 1;
        }
        list.push(Fresh { vertex: v, from: p, side, shared: u32::from(found.is_some()) });
        Ok(found)
    }

    /// Codes the row of `v`.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn place(
        &mut self,
        coder: &mut impl Coder,
        model: &mut LevelModel,
        memory: &mut Memory,
        surface: &Surface,
        rows: &mut Rows,
        (p, v, shares): (u32, u32, Option<u32>),
        own: Option<&[i32]>,
    ) {
        let (ring, star) = (&mut self.ring, &mut self.star);
        ring.clear();
        star.ring.clear();
        star.beyond.clear();
        star.valences.clear();
        star.normals.clear();
        star.misses = [0.0; 2];
        star.exact = 0;
        let mut last = NONE;
        for c in surface.around(surface.corner_of[v as usize]) {
            ring.push(surface.vertex(next(c)));
            let beyond = match surface.across[next(c) as usize] {
                NONE => None,
                other => Some(surface.vertex(previous(other))).filter(|&w| w < v).map(|w| exact_position(rows, w)),
            };
            star.beyond.push(beyond);
            last = c;
        }
        star.closed = surface.turn(last) != NONE;
        if !star.closed {
            ring.push(surface.vertex(previous(last)));
        }
        star.onto = ring.iter().position(|&r| r == p).unwrap_or(0);
        let share = 1.0 / ring.len() as f64;
        for &r in ring.iter() {
            star.ring.push(exact_position(rows, r));
            let site = &memory.sites[r as usize];
            star.valences.push(f64::from(site.valence));
            star.normals.push(site.normal.map(f64::from));
            star.exact += usize::from(site.is_exact());
            star.misses = [0, 1].map(|i| star.misses[i] + share * f64::from(site.misses[i]));
        }
        let (ring, star) = (&self.ring, &self.star);
        let truth = own.map(|o| [o[0], o[1], o[2]].map(|x| x >> rows.shift));
        let before = coder.position();
        let (place, miss, exact) = match shares {
            None => model.place.code(coder, star, self.mean_edge, truth),
            Some(w) => {
                rows.seams.push((v, memory.first(w)));
                let row = rows.row(w);
                let site = &memory.sites[w as usize];
                ([row[0], row[1], row[2]], site.misses.map(f64::from), site.is_exact())
            }
        };
        rows.values.extend(place);
        let placed = coder.position();
        self.spent.places += placed - before;
        for k in 3..rows.width {
            let sum: i64 = ring.iter().map(|&r| rows.value(r, k)).sum();
            let n = ring.len() as i64;
            let predicted = (2 * sum + n).div_euclid(2 * n) as i32;
            let residual = coder.signed(&mut model.attributes[k - 3], own.map_or(0, |o| o[k].wrapping_sub(predicted)));
            rows.values.push(predicted.wrapping_add(residual));
        }
        self.spent.attributes += coder.position() - placed;
        let miss = [miss[0] as f32, miss[1] as f32];
        for &r in ring {
            let m = &mut memory.sites[r as usize].misses;
            *m = [0.75 * m[0] + 0.25 * miss[0], 0.75 * m[1] + 0.25 * miss[1]];
        }
        let from = &mut memory.sites[p as usize];
        let new = Site {
            edge: from.edge,
            normal: star.normal().map(|x| x as f32),
            misses: miss,
            next: std::mem::replace(&mut from.next, v),
            valence: self.valence,
            birth: model.levels.min(255) as u8,
            marks: u8::from(exact),
        };
        memory.sites.push(new);
    }
}

fn exact_position(rows: &Rows, v: u32) -> P {
    [0, 1, 2].map(|k| rows.value(v, k) as f64)
}
