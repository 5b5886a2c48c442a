//! Section 4: the base block, and the block of loose vertices.

use super::Mesh;
use super::range::{Chance, Number, Range, Signed};
use std::collections::{HashMap, VecDeque};

struct Base<'a> {
    mesh: &'a mut Mesh,
    range: Range<'a>,
    /// `V`: vertices so far once the block is read.
    end: usize,
    queue: VecDeque<(usize, usize, usize)>,
    open: HashMap<(usize, usize), u32>,
    into: Vec<Vec<usize>>,
    out_of: Vec<Vec<usize>>,
    full: Vec<usize>,
    across: Vec<[Chance; 8]>,
    seed_known: Chance,
    number: Number,
    seam: Number,
    position: Vec<Signed>,
    attribute: Vec<Signed>,
}

/// Reads vertices until there are `end`, and `triangles` of them.
pub fn read(mesh: &mut Mesh, block: &[u8], end: usize, triangles: usize) -> Result<(), String> {
    let (count, attributes) = (mesh.count(), mesh.width - 3);
    let mut base = Base {
        mesh,
        range: Range::start(block),
        end,
        queue: VecDeque::new(),
        open: HashMap::new(),
        into: vec![Vec::new(); count],
        out_of: vec![Vec::new(); count],
        full: vec![0; count],
        across: vec![[Chance::default(); 8]; 49],
        seed_known: Chance::default(),
        number: Number::default(),
        seam: Number::default(),
        position: vec![Signed::default(); 24],
        attribute: vec![Signed::default(); attributes],
    };
    base.triangles(triangles)?;
    base.range.check()
}

impl Base<'_> {
    fn close(&mut self, a: usize, b: usize) -> bool {
        match self.open.get_mut(&(a, b)) {
            Some(count) if *count > 0 => {
                *count -= 1;
                true
            }
            _ => false,
        }
    }
    fn open_edge(&mut self, a: usize, b: usize, c: usize) {
        *self.open.entry((a, b)).or_default() += 1;
        self.queue.push_back((a, b, c));
        self.out_of[a].push(b);
        self.into[b].push(a);
    }
    fn is_open(&self, a: usize, b: usize) -> bool {
        self.open.get(&(a, b)).is_some_and(|count| *count > 0)
    }
    fn newest_into(&self, v: usize) -> Option<usize> {
        self.into[v].iter().rev().copied().find(|&x| self.is_open(x, v))
    }
    fn newest_out_of(&self, v: usize) -> Option<usize> {
        self.out_of[v].iter().rev().copied().find(|&x| self.is_open(v, x))
    }

    fn triangles(&mut self, count: usize) -> Result<(), String> {
        while self.mesh.triangles.len() < count {
            match self.queue.pop_front() {
                None => self.component()?,
                Some((a, b, o)) => self.edge(a, b, o)?,
            }
            self.range.check()?;
        }
        while self.mesh.count() < self.end {
            self.vertex(None)?;
            self.range.check()?;
        }
        Ok(())
    }

    fn component(&mut self) -> Result<(), String> {
        let mut t = [0; 3];
        for k in 0..3 {
            t[k] = if self.range.bit(&mut self.seed_known) {
                self.known()?
            } else if k == 0 {
                self.vertex(None)?
            } else {
                self.vertex(Some((t[k - 1], t[k - 1], t[k - 1])))?
            };
        }
        self.mesh.triangles.push(t);
        for k in 0..3 {
            let (a, b, c) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            self.full[a] = (self.full[a] + 1).min(255);
            if !self.close(b, a) {
                self.open_edge(a, b, c);
            }
        }
        Ok(())
    }

    fn edge(&mut self, a: usize, b: usize, o: usize) -> Result<(), String> {
        if !self.close(a, b) {
            return Ok(());
        }
        let (left, right) = (self.newest_into(a), self.newest_out_of(b));
        let context = self.full[a].min(6) * 7 + self.full[b].min(6);
        let c = match self.range.symbol(3, &mut self.across[context]) {
            1 => self.vertex(Some((a, b, o)))?,
            2 => left.ok_or("4.2: nothing on the left")?,
            3 => right.ok_or("4.2: nothing on the right")?,
            4 => self.known()?,
            _ => return Ok(()),
        };
        self.mesh.triangles.push([b, a, c]);
        for v in [b, a, c] {
            self.full[v] = (self.full[v] + 1).min(255);
        }
        for (x, y, z) in [(a, c, b), (c, b, a)] {
            if !self.close(y, x) {
                self.open_edge(x, y, z);
            }
        }
        Ok(())
    }

    fn known(&mut self) -> Result<usize, String> {
        let back = self.range.number(&mut self.number) as usize;
        self.mesh.count().checked_sub(1).and_then(|v| v.checked_sub(back)).ok_or("4.2: a known vertex before the first".into())
    }

    /// 4.3.
    fn vertex(&mut self, beside: Option<(usize, usize, usize)>) -> Result<usize, String> {
        let v = self.mesh.count();
        if v >= self.end {
            return Err("4.3: more vertices than the table says".into());
        }
        let mut shared = None;
        if self.mesh.with_seams {
            let back = self.range.number(&mut self.seam) as usize;
            if back > 0 {
                shared = Some(v.checked_sub(back).ok_or("4.3: a seam to before the first vertex")?);
            }
        }
        let value = |v: usize, k: usize| i64::from(self.mesh.value(v, k));
        let mut predicted = vec![0; self.mesh.width];
        for k in 0..self.mesh.width {
            predicted[k] = match beside {
                None if v == 0 => 0,
                None => value(v - 1, k),
                Some((a, b, o)) if k < 3 => value(a, k) + value(b, k) - value(o, k),
                Some((a, b, _)) => (value(a, k) + value(b, k)) >> 1,
            };
        }
        let scale = match (shared, beside) {
            (Some(_), _) => 0,
            (None, None) => 2048,
            (None, Some((a, b, o))) => (0..3).map(|k| (value(a, k) + value(b, k) - 2 * value(o, k)).abs()).sum::<i64>() / 4,
        };
        if let Some(p) = shared {
            (0..3).for_each(|k| predicted[k] = value(p, k));
        }
        let class = (64 - scale.leading_zeros()).min(23) as usize;
        let mut row = Vec::new();
        for k in 0..self.mesh.width {
            let model = if k < 3 { &mut self.position[class] } else { &mut self.attribute[k - 3] };
            row.push((predicted[k] as i32).wrapping_add(self.range.signed(model)));
        }
        if shared.is_some_and(|p| self.mesh.rows[p][..3] != row[..3]) {
            return Err("4.3: a seam between two positions".into());
        }
        self.mesh.push(row);
        if let Some(p) = shared {
            self.mesh.seam(v, p);
        }
        self.into.push(Vec::new());
        self.out_of.push(Vec::new());
        self.full.push(0);
        Ok(v)
    }
}
