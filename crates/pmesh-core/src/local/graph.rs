//! The partial order of collapses, and which of them are done.

use thiserror::Error;

/// Lists of numbers, one after the other.
#[derive(Clone, Debug, Default)]
struct Lists {
    ends: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    fn of(&self, i: u32) -> &[u32] {
        let start = i.checked_sub(1).map_or(0, |before| self.ends[before as usize]);
        &self.items[start as usize..self.ends[i as usize] as usize]
    }
    fn push(&mut self, list: &[u32]) {
        self.items.extend_from_slice(list);
        self.ends.push(self.items.len() as u32);
    }
    /// For each number, the lists that have it, ascending.
    fn turned(&self) -> Lists {
        let count = self.ends.len();
        let mut ends = vec![0u32; count];
        self.items.iter().for_each(|&i| ends[i as usize] += 1);
        let mut sum = 0;
        ends.iter_mut().for_each(|e| {
            sum += *e;
            *e = sum;
        });
        // Filled from behind, each list's end moves to its start; the starts are the ends of the lists before.
        let (mut at, mut items) = (ends.clone(), vec![0; self.items.len()]);
        for i in (0..count as u32).rev() {
            for &j in self.of(i) {
                at[j as usize] -= 1;
                items[at[j as usize] as usize] = i;
            }
        }
        Lists { ends, items }
    }
}

/// Why an order of collapses, or a step in it, is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs)] // the fields are named in the messages
pub enum Refusal {
    #[error("collapse {collapse} requires collapse {requires}, which is not an earlier one")]
    NotEarlier { collapse: u32, requires: u32 },
    #[error("collapse {collapse} names vertex {vertex}: it does not exist, is gone by then, or is both ends")]
    BadVertex { collapse: u32, vertex: u32 },
    #[error("the orders have {count} entries, more than 2^32 - 1")]
    TooMany { count: u64 },
    #[error("there is no collapse {collapse}")]
    NoSuchCollapse { collapse: u32 },
    #[error("collapse {collapse} is done already, or collapses that it requires are not")]
    CannotCollapse { collapse: u32 },
    #[error("collapse {collapse} is undone already, or collapses that require it are not")]
    CannotSplit { collapse: u32 },
}

/// Collapses, numbered in the order in which they were made, with what each requires; all are done at first (A.26, A.27).
///
/// 16 bytes a collapse and 8 for each pair in the order.
#[derive(Clone, Debug, Default)]
pub struct ConstraintGraph {
    requires: Lists,
    required_by: Lists,
    /// `C`: done.
    is_collapsed: Vec<bool>,
    /// Of each, how many that require it are done (A.27: its split constraints).
    split_constraints: Vec<u32>,
    /// Of each, how many that it requires are undone (A.27: its collapse constraints that are unmet).
    collapse_constraints: Vec<u32>,
}

impl ConstraintGraph {
    /// From the collapses that each collapse requires, ascending and all of them earlier ones. O(pairs).
    pub fn new<'a>(requires: impl IntoIterator<Item = &'a [u32]>) -> Result<Self, Refusal> {
        let mut lists = Lists::default();
        for list in requires {
            let collapse = lists.ends.len() as u32;
            if let Some(&requires) = list.iter().find(|&&r| r >= collapse) {
                return Err(Refusal::NotEarlier { collapse, requires });
            }
            let count = lists.items.len() as u64 + list.len() as u64;
            if count > u64::from(u32::MAX) || lists.ends.len() as u64 >= u64::from(u32::MAX) {
                return Err(Refusal::TooMany { count });
            }
            lists.push(list);
        }
        let required_by = lists.turned();
        let count = lists.ends.len();
        let split_constraints = (0..count as u32).map(|i| required_by.of(i).len() as u32).collect();
        Ok(Self {
            requires: lists,
            required_by,
            is_collapsed: vec![true; count],
            split_constraints,
            collapse_constraints: vec![0; count],
        })
    }

    /// The same order, all collapses done, without the pairs that follow from others: what is required by something that is required too. About a seventh is
    /// left, and with it of the work of each step. O(pairs × what each requires).
    pub fn reduced(&self) -> Result<Self, Refusal> {
        let mut seen_by = vec![u32::MAX; self.is_collapsed.len()];
        let lists: Vec<Vec<u32>> = (0..self.len())
            .map(|i| {
                self.requires(i).iter().flat_map(|&k| self.requires(k)).for_each(|&j| seen_by[j as usize] = i);
                self.requires(i).iter().copied().filter(|&k| seen_by[k as usize] != i).collect()
            })
            .collect();
        Self::new(lists.iter().map(|l| &l[..]))
    }

    /// Collapses.
    pub fn len(&self) -> u32 {
        self.is_collapsed.len() as u32
    }
    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.is_collapsed.is_empty()
    }
    /// `C`; false: `S`, or there is no such collapse.
    pub fn is_collapsed(&self, i: u32) -> bool {
        self.is_collapsed.get(i as usize).copied().unwrap_or(false)
    }
    /// What must be done before collapse `i`.
    pub fn requires(&self, i: u32) -> &[u32] {
        self.requires.of(i)
    }
    /// What must be undone before `i` is.
    pub fn required_by(&self, i: u32) -> &[u32] {
        self.required_by.of(i)
    }
    /// Collapses that stand in the way of undoing `i`, and of doing it (A.27).
    pub fn constraints(&self, i: u32) -> (u32, u32) {
        (self.split_constraints[i as usize], self.collapse_constraints[i as usize])
    }
    /// True if `i` may be undone now. O(1).
    pub fn can_split(&self, i: u32) -> bool {
        self.is_collapsed(i) && self.split_constraints[i as usize] == 0
    }
    /// True if `i` may be done now. O(1).
    pub fn can_collapse(&self, i: u32) -> bool {
        i < self.len() && !self.is_collapsed(i) && self.collapse_constraints[i as usize] == 0
    }

    /// Undoes `i`. O(what requires it and what it requires).
    pub fn split(&mut self, i: u32) -> Result<(), Refusal> {
        if !self.can_split(i) {
            return Err(self.refusal(i, Refusal::CannotSplit { collapse: i }));
        }
        self.is_collapsed[i as usize] = false;
        self.requires.of(i).iter().for_each(|&r| self.split_constraints[r as usize] -= 1);
        self.required_by.of(i).iter().for_each(|&r| self.collapse_constraints[r as usize] += 1);
        Ok(())
    }
    /// Does `i`. O(what requires it and what it requires).
    pub fn collapse(&mut self, i: u32) -> Result<(), Refusal> {
        if !self.can_collapse(i) {
            return Err(self.refusal(i, Refusal::CannotCollapse { collapse: i }));
        }
        self.is_collapsed[i as usize] = true;
        self.requires.of(i).iter().for_each(|&r| self.split_constraints[r as usize] += 1);
        self.required_by.of(i).iter().for_each(|&r| self.collapse_constraints[r as usize] -= 1);
        Ok(())
    }
    fn refusal(&self, collapse: u32, otherwise: Refusal) -> Refusal {
        if collapse < self.len() { otherwise } else { Refusal::NoSuchCollapse { collapse } }
    }

    /// The collapses to undo, in an order in which that is allowed, so that all of `wanted` are undone (A.29): what requires them goes
    /// first. O(collapses in the answer and their pairs).
    pub fn split_order(&self, wanted: &[u32]) -> Result<Vec<u32>, Refusal> {
        self.order(wanted, true, &self.required_by)
    }
    /// The collapses to do so that all of `wanted` are done: what they require goes first.
    pub fn collapse_order(&self, wanted: &[u32]) -> Result<Vec<u32>, Refusal> {
        self.order(wanted, false, &self.requires)
    }

    /// Depth first, without recursion: a collapse comes after all that `first` lists for it and that are in the state `from`.
    fn order(&self, wanted: &[u32], from: bool, first: &Lists) -> Result<Vec<u32>, Refusal> {
        let mut seen = std::collections::HashSet::new();
        let (mut order, mut stack) = (Vec::new(), Vec::new());
        for &root in wanted {
            if root >= self.len() {
                return Err(Refusal::NoSuchCollapse { collapse: root });
            }
            if self.is_collapsed(root) == from && seen.insert(root) {
                stack.push((root, 0));
            }
            while let Some((i, next)) = stack.last_mut() {
                match first.of(*i).get(*next) {
                    Some(&before) => {
                        *next += 1;
                        if self.is_collapsed(before) == from && seen.insert(before) {
                            stack.push((before, 0));
                        }
                    }
                    None => {
                        order.push(*i);
                        stack.pop();
                    }
                }
            }
        }
        Ok(order)
    }

    /// Panics unless the counts are what the states say and no collapse is done without what it requires; tests call it.
    pub fn check_invariants(&self) {
        for i in 0..self.len() {
            let undone = self.requires(i).iter().filter(|&&r| !self.is_collapsed(r)).count() as u32;
            let done = self.required_by(i).iter().filter(|&&r| self.is_collapsed(r)).count() as u32;
            assert_eq!(self.constraints(i), (done, undone), "collapse {i}");
            assert!(!self.is_collapsed(i) || undone == 0, "collapse {i} is done, and {undone} that it requires are not");
        }
    }
}
