//! Shape of the rows of a table: which cells are numbers.

use std::collections::BTreeMap;

/// Content of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing was measured.
    Nothing,
    /// A number, or a time of day.
    Number,
    /// Anything else.
    Text,
}

/// The columns of most rows of a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Content of most cells of each column.
    columns: Vec<Kind>,
    /// Numbers that a row has at least.
    fewest: usize,
}

impl Shape {
    /// The shape of most of `rows` rows, whose cells `kinds` gives: of those that have `fewest` numbers. None where there are no such rows.
    pub fn of_most(rows: usize, kinds: impl Fn(usize) -> Vec<Kind>, fewest: usize) -> Option<Self> {
        const SAMPLE: usize = 400;
        // Behind any preamble.
        let from = rows * 2 / 5;
        let step = ((rows - from) / SAMPLE).max(1);
        let mut by_length: BTreeMap<usize, Vec<Vec<Kind>>> = BTreeMap::new();
        for kinds in (from..rows).step_by(step).map(kinds) {
            if kinds.iter().filter(|kind| **kind == Kind::Number).count() >= fewest {
                by_length.entry(kinds.len()).or_default().push(kinds);
            }
        }
        let most = by_length.into_values().max_by_key(Vec::len)?;
        let usual = |column: usize| {
            let count = |wanted: Kind| most.iter().filter(|row| row[column] == wanted).count();
            let (numbers, texts) = (count(Kind::Number), count(Kind::Text));
            // Cells may be empty in most rows, as where one quantity is logged more slowly.
            if numbers > texts && numbers > 0 {
                Kind::Number
            } else if texts > 0 {
                Kind::Text
            } else {
                Kind::Nothing
            }
        };
        Some(Self { columns: (0..most[0].len()).map(usual).collect(), fewest })
    }

    /// Whether `row` is a row of numbers.
    pub fn has(&self, row: &[Kind]) -> bool {
        self.fits(row, false)
    }

    /// Whether `row` is a row of numbers that may have anything before the first of them, all numbers of which are there.
    pub fn may_have_settings(&self, row: &[Kind]) -> bool {
        let is_whole = |(kind, usual): (&Kind, &Kind)| *usual != Kind::Number || *kind == Kind::Number;
        row.len() >= self.columns.len() && row.iter().zip(&self.columns).all(is_whole) && self.fits(row, true)
    }

    fn fits(&self, row: &[Kind], with_settings: bool) -> bool {
        let first = self.columns.iter().position(|kind| *kind == Kind::Number).unwrap_or(0);
        let fits = |(index, (kind, usual)): (usize, (&Kind, &Kind))| match usual {
            Kind::Number => *kind != Kind::Text,
            Kind::Nothing if index < first && !with_settings => *kind == Kind::Nothing,
            Kind::Nothing | Kind::Text => true,
        };
        let numbers = row.iter().filter(|kind| **kind == Kind::Number).count();
        2 * row.len() > self.columns.len()
            && (numbers >= self.fewest || row.get(first) == Some(&Kind::Number))
            && row.iter().zip(&self.columns).enumerate().all(fits)
    }

    /// Whether `row` may be a row of numbers, with a fault.
    pub fn may_have(&self, row: &[Kind]) -> bool {
        let numbers = row.iter().filter(|kind| **kind == Kind::Number).count();
        numbers >= self.fewest || (numbers > 0 && row.len() == self.columns.len())
    }

    /// Whether a row of these kinds and `cells` is no row of numbers: it begins with a word.
    pub fn is_remark(&self, row: &[Kind], cells: &[&str]) -> bool {
        let first = row.iter().position(|kind| *kind != Kind::Nothing);
        let begins = |cell: &str| cell.starts_with(|c: char| c.is_alphabetic() || "*=_<[".contains(c));
        !self.has(row) && first.is_none_or(|first| row[first] == Kind::Text && begins(cells[first]))
    }
}
