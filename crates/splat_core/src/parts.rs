//! [`Parts`]: named, coloured, disjoint sets of Gaussians.

use crate::{SelectMode, Selection};

/// Label of a part in a [`Parts`]: 1 and up. Labels of removed parts come back only when all 65,535 were used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartId(pub u16);

/// What a part is called and how it is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its name; names may repeat.
    pub name: String,
    /// Colour it is shown in: red, green, blue, sRGB-encoded.
    pub color: [u8; 3],
    parent: Option<PartId>,
    locked: bool,
}

impl Part {
    /// The part it belongs to.
    pub fn parent(&self) -> Option<PartId> {
        self.parent
    }

    /// Whether it was locked itself; see [`Parts::locked`] for whether it may change.
    pub fn locked(&self) -> bool {
        self.locked
    }
}

/// Whether the parts below one count as its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Children {
    /// They do.
    #[default]
    With,
    /// They do not.
    Without,
}

/// Why a part could not be made or changed; nothing has changed then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PartsError {
    /// There is no such part.
    #[error("there is no part {}; it may have been removed", .0.0)]
    Unknown(PartId),
    /// The part, or the one it belongs to, is locked.
    #[error("part {} is locked; unlock it first", .0.0)]
    Locked(PartId),
    /// Parts nest one level deep.
    #[error("part {} belongs to another part itself and cannot have parts; choose the upper one", .0.0)]
    Nested(PartId),
    /// A stored table names a part more than once.
    #[error("part {} is in the table twice; the file is damaged", .0.0)]
    Twice(PartId),
    /// All labels are in use.
    #[error("65535 parts are the most a cloud can have; remove some")]
    Full,
    /// A selection, or labels, of another cloud.
    #[error("the selection is of {found} Gaussians, the parts are of {expected}: two clouds were mixed")]
    Length {
        /// Gaussians of the parts' cloud.
        expected: usize,
        /// Gaussians of what was given.
        found: usize,
    },
}

/// One label per Gaussian and the table of the parts they name. A Gaussian has one label at most: parts cannot overlap.
///
/// A part may belong to another (one level deep). It is a piece of that: what leaves it goes to the upper part, and changing the
/// upper one as a whole changes it too. Locked parts neither gain nor lose; locking a part locks those below it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    labels: Vec<u16>,
    table: Vec<Option<Part>>,
}

impl Parts {
    /// No parts, of `len` Gaussians.
    pub fn new(len: usize) -> Self {
        Self { labels: vec![0; len], table: Vec::new() }
    }

    /// Parts from labels (0: the rest), such as those of a file. Every label up to the highest gets a part named `part N`, in a
    /// colour of its own.
    pub fn from_labels(labels: Vec<u16>) -> Self {
        let highest = labels.iter().copied().max().unwrap_or(0);
        let part = |k| Some(Part { name: format!("part {k}"), color: part_color(k), parent: None, locked: false });
        Self { labels, table: (1..=highest).map(part).collect() }
    }

    /// Parts from labels, the number of labels given out, and the rows of a table: id, name, colour, the part it belongs to, locked.
    #[cfg(feature = "serde")]
    pub(crate) fn from_table(
        labels: Vec<u16>,
        used: u16,
        rows: impl Iterator<Item = (PartId, String, [u8; 3], Option<PartId>, bool)>,
    ) -> Result<Self, PartsError> {
        let mut table = vec![None; usize::from(used)];
        for (id, name, color, parent, locked) in rows {
            let row = slot(id).and_then(|at| table.get_mut(at)).ok_or(PartsError::Unknown(id))?;
            if row.replace(Part { name, color, parent, locked }).is_some() {
                return Err(PartsError::Twice(id));
            }
        }
        let parts = Self { labels, table };
        for (_, part) in parts.iter() {
            if let Some(up) = part.parent
                && parts.known(up)?.parent.is_some()
            {
                return Err(PartsError::Nested(up));
            }
        }
        // A label is asked for once a run: there are far fewer of these than Gaussians.
        for run in parts.labels.chunk_by(|a, b| a == b).filter(|run| run[0] != 0) {
            parts.known(PartId(run[0]))?;
        }
        Ok(parts)
    }

    /// How many labels were given out so far, those of removed parts included.
    #[cfg(feature = "serde")]
    pub(crate) fn used(&self) -> u16 {
        // `add` stops at 65,535.
        self.table.len() as u16
    }

    /// Number of Gaussians of the cloud this belongs to.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether the cloud has no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Label of every Gaussian, 0 where it has no part.
    pub fn labels(&self) -> &[u16] {
        &self.labels
    }

    /// The part of Gaussian `i`; `None` for the rest and beyond the end.
    pub fn part_of(&self, i: usize) -> Option<PartId> {
        self.labels.get(i).copied().filter(|&label| label != 0).map(PartId)
    }

    /// All parts, by rising label.
    pub fn iter(&self) -> impl Iterator<Item = (PartId, &Part)> {
        (1..).zip(&self.table).filter_map(|(k, part)| Some((PartId(k), part.as_ref()?)))
    }

    /// A part.
    pub fn get(&self, part: PartId) -> Option<&Part> {
        self.table.get(slot(part)?)?.as_ref()
    }

    /// Whether the part, or the one it belongs to, is locked; `false` for parts that do not exist.
    pub fn locked(&self, part: PartId) -> bool {
        let locked = |p: &Part| p.locked || p.parent.and_then(|up| self.get(up)).is_some_and(|up| up.locked);
        self.get(part).is_some_and(locked)
    }

    /// Makes an empty part, below `parent` where one is given.
    ///
    /// # Errors
    /// [`PartsError::Unknown`], [`PartsError::Nested`] or [`PartsError::Locked`] for the parent, [`PartsError::Full`].
    pub fn add(
        &mut self,
        name: impl Into<String>,
        color: [u8; 3],
        parent: Option<PartId>,
    ) -> Result<PartId, PartsError> {
        if let Some(up) = parent {
            if self.known(up)?.parent.is_some() {
                return Err(PartsError::Nested(up));
            }
            self.unlocked(up)?;
        }
        let part = Some(Part { name: name.into(), color, parent, locked: false });
        if self.table.len() < usize::from(u16::MAX) {
            self.table.push(part);
            return Ok(PartId(self.table.len() as u16));
        }
        let free = self.table.iter().position(Option::is_none).ok_or(PartsError::Full)?;
        self.table[free] = part;
        Ok(PartId(free as u16 + 1))
    }

    /// Removes a part. Its Gaussians go to the part it belonged to, or to the rest; parts below it stay, on their own.
    ///
    /// # Errors
    /// [`PartsError::Unknown`] or [`PartsError::Locked`].
    pub fn remove(&mut self, part: PartId) -> Result<(), PartsError> {
        let heir = self.heir(part)?;
        self.unlocked(part)?;
        for label in self.labels.iter_mut().filter(|label| **label == part.0) {
            *label = heir;
        }
        for below in self.table.iter_mut().flatten().filter(|below| below.parent == Some(part)) {
            below.parent = None;
        }
        self.table[usize::from(part.0) - 1] = None;
        Ok(())
    }

    /// Gives a part another name.
    ///
    /// # Errors
    /// [`PartsError::Unknown`]. Locks protect Gaussians, not names.
    pub fn rename(&mut self, part: PartId, name: impl Into<String>) -> Result<(), PartsError> {
        self.known_mut(part)?.name = name.into();
        Ok(())
    }

    /// Gives a part another colour.
    ///
    /// # Errors
    /// [`PartsError::Unknown`].
    pub fn recolor(&mut self, part: PartId, color: [u8; 3]) -> Result<(), PartsError> {
        self.known_mut(part)?.color = color;
        Ok(())
    }

    /// Locks a part and those below it: their Gaussians stay theirs, and no other joins them.
    ///
    /// # Errors
    /// [`PartsError::Unknown`].
    pub fn lock(&mut self, part: PartId) -> Result<(), PartsError> {
        self.known_mut(part)?.locked = true;
        Ok(())
    }

    /// Takes the part's own lock away.
    ///
    /// # Errors
    /// [`PartsError::Unknown`].
    pub fn unlock(&mut self, part: PartId) -> Result<(), PartsError> {
        self.known_mut(part)?.locked = false;
        Ok(())
    }

    /// Changes which Gaussians a part has, parts below it included, by a selection:
    /// `New` exactly those, `Add` those too, `Subtract` not those, `Intersect` only those of its own.
    ///
    /// What it gains leaves other parts, except locked ones. What it loses goes to the part it belongs to, or to the rest. Gaussians
    /// of a part below stay there as long as they stay in the whole.
    ///
    /// # Errors
    /// [`PartsError::Unknown`], [`PartsError::Locked`] or [`PartsError::Length`].
    pub fn assign(&mut self, part: PartId, selection: &Selection, mode: SelectMode) -> Result<(), PartsError> {
        let heir = self.heir(part)?;
        self.unlocked(part)?;
        if selection.len() != self.len() {
            return Err(PartsError::Length { expected: self.len(), found: selection.len() });
        }
        let mut fixed = vec![false; self.table.len() + 1];
        let mut whole = fixed.clone();
        for (id, other) in self.iter() {
            fixed[usize::from(id.0)] = self.locked(id);
            whole[usize::from(id.0)] = id == part || other.parent == Some(part);
        }
        for (i, label) in self.labels.iter_mut().enumerate() {
            let had = whole[usize::from(*label)];
            let given = selection.contains(i);
            let has = match mode {
                SelectMode::New => given,
                SelectMode::Add => had || given,
                SelectMode::Subtract => had && !given,
                SelectMode::Intersect => had && given,
            };
            if had != has && !fixed[usize::from(*label)] {
                *label = if has { part.0 } else { heir };
            }
        }
        Ok(())
    }

    /// The Gaussians of a part; none of a part that does not exist.
    pub fn selection_of(&self, part: PartId, children: Children) -> Selection {
        let mut wanted = vec![false; self.table.len() + 1];
        for (id, other) in self.iter() {
            wanted[usize::from(id.0)] = id == part || children == Children::With && other.parent == Some(part);
        }
        Selection::from_fn(self.len(), |i| wanted[usize::from(self.labels[i])])
    }

    /// The Gaussians without a part.
    pub fn rest(&self) -> Selection {
        Selection::from_fn(self.len(), |i| self.labels[i] == 0)
    }

    fn known(&self, part: PartId) -> Result<&Part, PartsError> {
        self.get(part).ok_or(PartsError::Unknown(part))
    }

    fn known_mut(&mut self, part: PartId) -> Result<&mut Part, PartsError> {
        let found = slot(part).and_then(|k| self.table.get_mut(k)).and_then(Option::as_mut);
        found.ok_or(PartsError::Unknown(part))
    }

    fn unlocked(&self, part: PartId) -> Result<(), PartsError> {
        if self.locked(part) { Err(PartsError::Locked(part)) } else { Ok(()) }
    }

    /// Label of what leaves a part.
    fn heir(&self, part: PartId) -> Result<u16, PartsError> {
        Ok(self.known(part)?.parent.map_or(0, |up| up.0))
    }
}

fn slot(part: PartId) -> Option<usize> {
    usize::from(part.0).checked_sub(1)
}

/// A colour for the `k`-th part that differs from those of its neighbours: hues a golden angle apart.
pub fn part_color(k: u16) -> [u8; 3] {
    let hue = f64::from(k) * 0.618_033_988_749_895 % 1.0 * 6.0;
    let channel = |shift: f64| {
        let at = (hue + shift) % 6.0;
        let share = (2.0 - (at - 3.0).abs()).clamp(0.0, 1.0);
        (70.0 + 175.0 * share).round() as u8
    };
    // Each channel is fullest a third of the circle after the other.
    [channel(3.0), channel(1.0), channel(5.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(len: usize, list: &[u32]) -> Selection {
        Selection::from_ids(len, list.iter().copied())
    }

    #[test]
    fn a_gaussian_has_one_part_at_most() {
        let mut parts = Parts::new(8);
        let a = parts.add("chair", [255, 0, 0], None).unwrap();
        let b = parts.add("table", [0, 255, 0], None).unwrap();
        parts.assign(a, &ids(8, &[0, 1, 2, 3]), SelectMode::New).unwrap();
        parts.assign(b, &ids(8, &[3, 4]), SelectMode::Add).unwrap();
        assert_eq!(parts.labels(), [1, 1, 1, 2, 2, 0, 0, 0]);
        parts.assign(a, &ids(8, &[2, 3, 7]), SelectMode::Intersect).unwrap();
        assert_eq!(parts.labels(), [0, 0, 1, 2, 2, 0, 0, 0]);
        parts.assign(a, &ids(8, &[5, 6]), SelectMode::New).unwrap();
        assert_eq!(parts.labels(), [0, 0, 0, 2, 2, 1, 1, 0]);
        parts.assign(b, &ids(8, &[0, 4, 5]), SelectMode::Subtract).unwrap();
        assert_eq!(parts.labels(), [0, 0, 0, 2, 0, 1, 1, 0]);
        assert_eq!(parts.rest(), ids(8, &[0, 1, 2, 4, 7]));
        assert_eq!((parts.part_of(3), parts.part_of(0), parts.part_of(99)), (Some(b), None, None));
    }

    #[test]
    fn parts_below_are_pieces_of_the_upper_one() {
        let mut parts = Parts::new(8);
        let chair = parts.add("chair", [9; 3], None).unwrap();
        let seat = parts.add("seat", [9; 3], Some(chair)).unwrap();
        parts.assign(chair, &ids(8, &[0, 1, 2, 3]), SelectMode::New).unwrap();
        parts.assign(seat, &ids(8, &[1, 2]), SelectMode::New).unwrap();
        assert_eq!(parts.labels(), [1, 2, 2, 1, 0, 0, 0, 0]);
        assert_eq!(parts.selection_of(chair, Children::With), ids(8, &[0, 1, 2, 3]));
        assert_eq!(parts.selection_of(chair, Children::Without), ids(8, &[0, 3]));
        // The seat keeps what stays in the chair; what leaves the seat goes to the chair.
        parts.assign(chair, &ids(8, &[2, 3, 4]), SelectMode::New).unwrap();
        assert_eq!(parts.labels(), [0, 0, 2, 1, 1, 0, 0, 0]);
        parts.assign(seat, &ids(8, &[2]), SelectMode::Subtract).unwrap();
        assert_eq!(parts.labels(), [0, 0, 1, 1, 1, 0, 0, 0]);
        assert_eq!(parts.add("leg of seat", [0; 3], Some(seat)), Err(PartsError::Nested(seat)));
    }

    #[test]
    fn locked_parts_neither_gain_nor_lose() {
        let mut parts = Parts::new(6);
        let a = parts.add("a", [0; 3], None).unwrap();
        let below = parts.add("below", [0; 3], Some(a)).unwrap();
        let b = parts.add("b", [0; 3], None).unwrap();
        parts.assign(a, &ids(6, &[0, 1]), SelectMode::New).unwrap();
        parts.assign(below, &ids(6, &[1]), SelectMode::New).unwrap();
        parts.lock(a).unwrap();
        let before = parts.clone();
        for part in [a, below] {
            assert!(parts.locked(part));
            assert_eq!(parts.assign(part, &Selection::all(6), SelectMode::Add), Err(PartsError::Locked(part)));
            assert_eq!(parts.remove(part), Err(PartsError::Locked(part)));
        }
        assert_eq!(parts.add("c", [0; 3], Some(a)), Err(PartsError::Locked(a)));
        assert_eq!(parts, before);
        parts.assign(b, &Selection::all(6), SelectMode::New).unwrap();
        assert_eq!(parts.labels(), [1, 2, 3, 3, 3, 3]);
        parts.rename(a, "still mine").unwrap();
        parts.recolor(a, [1, 2, 3]).unwrap();
        assert_eq!((parts.get(a).unwrap().name.as_str(), parts.get(a).unwrap().color), ("still mine", [1, 2, 3]));
        parts.unlock(a).unwrap();
        parts.assign(b, &Selection::all(6), SelectMode::New).unwrap();
        assert_eq!(parts.selection_of(b, Children::With).count(), 6);
    }

    #[test]
    fn a_locked_part_below_stays_when_the_upper_one_shrinks() {
        let mut parts = Parts::new(4);
        let a = parts.add("a", [0; 3], None).unwrap();
        let below = parts.add("below", [0; 3], Some(a)).unwrap();
        parts.assign(a, &Selection::all(4), SelectMode::New).unwrap();
        parts.assign(below, &ids(4, &[1, 2]), SelectMode::New).unwrap();
        parts.lock(below).unwrap();
        parts.assign(a, &ids(4, &[0]), SelectMode::New).unwrap();
        assert_eq!(parts.labels(), [1, 2, 2, 0]);
    }

    #[test]
    fn removing_a_part_leaves_its_gaussians_to_the_upper_one() {
        let mut parts = Parts::from_labels(vec![0, 1, 2, 2]);
        assert_eq!(parts.iter().count(), 2);
        let leg = parts.add("leg", [0; 3], Some(PartId(2))).unwrap();
        parts.assign(leg, &ids(4, &[3]), SelectMode::New).unwrap();
        let mut without_leg = parts.clone();
        without_leg.remove(leg).unwrap();
        assert_eq!(without_leg.labels(), [0, 1, 2, 2]);
        parts.remove(PartId(2)).unwrap();
        assert_eq!(parts.labels(), [0, 1, 0, 3]);
        assert_eq!(parts.get(leg).unwrap().parent(), None);
        assert_eq!(parts.selection_of(PartId(2), Children::With).count(), 0);
        assert_eq!(parts.remove(PartId(2)), Err(PartsError::Unknown(PartId(2))));
        assert_eq!(parts.rename(PartId(0), "rest"), Err(PartsError::Unknown(PartId(0))));
        let mixed = parts.assign(PartId(1), &Selection::none(9), SelectMode::New);
        assert_eq!(mixed, Err(PartsError::Length { expected: 4, found: 9 }));
    }

    #[test]
    fn labels_run_out_and_come_back() {
        let mut parts = Parts::new(1);
        for _ in 0..65_535 {
            parts.add("", [0; 3], None).unwrap();
        }
        assert_eq!(parts.add("", [0; 3], None), Err(PartsError::Full));
        parts.remove(PartId(77)).unwrap();
        assert_eq!(parts.add("", [0; 3], None), Ok(PartId(77)));
    }

    #[test]
    fn colours_of_the_first_parts_differ() {
        let colors: Vec<[u8; 3]> = (1..40).map(part_color).collect();
        for (k, a) in colors.iter().enumerate() {
            for b in &colors[..k] {
                assert!(a.iter().zip(b).any(|(x, y)| x.abs_diff(*y) > 4), "{a:?} {b:?}");
            }
        }
    }
}
