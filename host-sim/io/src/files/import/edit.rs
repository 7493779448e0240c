//! Selection of the rows of a file: a part of the time, without drop-outs, fewer rows.

use super::{Fill, Quantity, Series};
use crate::error::{Error, Result};
use crate::quantity::positive;
use crate::terminal::rounded;

/// Changes to the rows of a file, in the order in which they are made.
#[derive(Clone, Debug, PartialEq)]
pub struct Edits {
    /// Readings to discard.
    pub blanks: Vec<Blank>,
    /// First time that is kept, s from the first row.
    pub from_s: f64,
    /// Last time that is kept.
    pub to_s: f64,
    /// Rows that become one: their mean.
    pub decimate: usize,
}

impl Edits {
    /// The rows as they are.
    pub const NONE: Self = Self { blanks: Vec::new(), from_s: 0.0, to_s: f64::INFINITY, decimate: 1 };

    /// Without `blanks`, from `from_s` to `to_s` or the end, `decimate` rows to one.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for what leaves no rows.
    pub fn new(blanks: Vec<Blank>, from_s: f64, to_s: Option<f64>, decimate: usize) -> Result<Self> {
        if !(from_s.is_finite() && from_s >= 0.0) {
            return Err(Error::field("from_s", format!("{from_s:?} must be at least 0")));
        }
        if let Some(to_s) = to_s {
            positive("to_s", to_s)?;
            if to_s <= from_s {
                return Err(Error::field("to_s", format!("{to_s:?} must lie above `from_s`")));
            }
        }
        if decimate == 0 {
            return Err(Error::field("decimate", "1 keeps every row"));
        }
        Ok(Self { blanks, from_s, to_s: to_s.unwrap_or(f64::INFINITY), decimate })
    }
}

/// Readings to discard: drop-outs of a sensor.
#[derive(Clone, Debug, PartialEq)]
pub enum Blank {
    /// Those of a quantity that are exactly this number of the file.
    Equal(Quantity, f64),
    /// Those above this number of the file.
    Above(Quantity, f64),
    /// Those below it.
    Below(Quantity, f64),
    /// Those between these times, s from the first row.
    During(Quantity, f64, f64),
    /// Cells of this word, which is no reading. They are emptied as the file is read: [`Hints::words`](super::Hints).
    Word(String),
}

/// Longest drop-out of what drives a film, s.
const DROP_OUT_S: f64 = 1.0;

impl Blank {
    /// The readings that it did not find.
    fn what(&self) -> String {
        match self {
            Self::Equal(_, value) => format!("no number is {value}"),
            Self::Above(_, value) => format!("no number is above {value}"),
            Self::Below(_, value) => format!("no number is below {value}"),
            Self::During(_, from, to) => format!("no reading is from {from} to {to} s"),
            Self::Word(word) => format!("no cell is {word:?}"),
        }
    }

    /// The words among `blanks`.
    pub fn words(blanks: &[Self]) -> Vec<String> {
        let word = |blank: &Self| if let Self::Word(word) = blank { Some(word.clone()) } else { None };
        blanks.iter().filter_map(word).collect()
    }
}

impl std::str::FromStr for Blank {
    type Err = String;

    /// `displacement=-9999`, `displacement>12`, `displacement<-1`, `voltage:12.5..13`, `12.5..13` or a word.
    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let fault = || {
            format!(
                "{text:?}: use such as displacement=-9999, \"displacement>12\", voltage:12.5..13 (s), 12.5..13 of the displacement, or a word"
            )
        };
        let quantity = |name: &str| {
            let all = [Quantity::Displacement, Quantity::Force, Quantity::Voltage];
            all.into_iter().find(|quantity| quantity.name() == name.trim()).ok_or_else(fault)
        };
        if let Some((from, to)) = text.split_once("..") {
            let (of, from) = from.split_once(':').unwrap_or((Quantity::Displacement.name(), from));
            let of = quantity(of)?;
            return match (number(from), number(to)) {
                (Some(from), Some(to)) if from <= to => Ok(Self::During(of, from, to)),
                _ => Err(fault()),
            };
        }
        let Some(at) = text.find(['=', '<', '>']) else {
            let word = text.trim();
            let is_time = word.split_once(':').is_some_and(|(name, _)| quantity(name).is_ok());
            return if word.is_empty() || is_time || number(word).is_some() {
                Err(fault())
            } else {
                Ok(Self::Word(word.into()))
            };
        };
        let quantity = quantity(&text[..at])?;
        let value = number(&text[at + 1..]).ok_or_else(fault)?;
        Ok(match &text[at..=at] {
            "=" => Self::Equal(quantity, value),
            ">" => Self::Above(quantity, value),
            _ => Self::Below(quantity, value),
        })
    }
}

impl Series {
    /// The same, edited, where what drives the film was blanked with its cells filled; and how many readings were blanked.
    ///
    /// # Errors
    ///
    /// What leaves too few rows.
    pub fn edited(mut self, edits: &Edits, fill: Option<Fill>) -> std::result::Result<(Self, usize), String> {
        let mut blanked = 0;
        for blank in &edits.blanks {
            blanked += self.blank(blank)?;
        }
        if let Some(fill) = fill.filter(|_| blanked > 0) {
            self.fill(fill);
        }
        let start = self.clock_s[0];
        let inside = |t: f64| (edits.from_s..=edits.to_s).contains(&(t - start));
        if !self.clock_s.iter().all(|t| inside(*t)) {
            let kept: Vec<usize> = (0..self.clock_s.len()).filter(|k| inside(self.clock_s[*k])).collect();
            self = self.with_rows(kept.len(), |values, row| values[kept[row]], |cells, row| cells[kept[row]]);
        }
        if edits.decimate > 1 {
            let every = edits.decimate;
            let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
            let rows = self.clock_s.len() / every;
            self = self.with_rows(
                rows,
                |values, row| mean(&values[row * every..][..every]),
                |cells, row| {
                    let present: Vec<f64> = cells[row * every..][..every].iter().copied().flatten().collect();
                    (!present.is_empty()).then(|| mean(&present))
                },
            );
        }
        match self.clock_s.len() {
            rows @ (0 | 1) => Err(format!("{rows} rows are left; a recording needs at least 2")),
            _ => Ok((self, blanked)),
        }
    }

    /// Empties the cells of `blank` and counts them.
    fn blank(&mut self, blank: &Blank) -> std::result::Result<usize, String> {
        let (quantity, value) = match *blank {
            Blank::Equal(quantity, value) | Blank::Above(quantity, value) | Blank::Below(quantity, value) => {
                (quantity, value)
            }
            Blank::During(quantity, ..) => (quantity, 0.0),
            Blank::Word(_) => return Ok(0),
        };
        let start = self.clock_s[0];
        // As the numbers of the file were taken: the same product is the same number.
        let factor = self.understood.column(quantity).map_or(1.0, |column| column.factor);
        let (limit, turned) = (value * factor, factor < 0.0);
        let clock_s = &self.clock_s;
        let column = self.columns.iter_mut().find(|(which, _)| *which == quantity);
        let (_, column) = column.ok_or_else(|| format!("no {quantity} to blank"))?;
        let is_blanked = |(row, cell): (usize, &Option<f64>)| {
            cell.is_some_and(|cell| match *blank {
                Blank::Equal(..) => cell == limit,
                Blank::Above(..) => (cell > limit) != turned && cell != limit,
                Blank::Below(..) => (cell < limit) != turned && cell != limit,
                Blank::During(_, from, to) => (from..=to).contains(&(clock_s[row] - start)),
                Blank::Word(_) => false,
            })
        };
        let emptied: Vec<usize> =
            column.cells().iter().enumerate().filter(|cell| is_blanked(*cell)).map(|(row, _)| row).collect();
        let mut cells = column.cells().to_vec();
        emptied.iter().for_each(|row| cells[*row] = None);
        *column = column.with_cells(cells);
        let length_s = |piece: &[usize]| clock_s[piece[piece.len() - 1]] - clock_s[piece[0]];
        let longest_s = emptied.chunk_by(|a, b| a + 1 == *b).map(length_s).fold(0.0, f64::max);
        let is_by_value = !matches!(blank, Blank::During(..)) && quantity != Quantity::Displacement;
        if emptied.is_empty() {
            self.understood.notes.push(format!("`blank` of the {quantity} empties nothing: {}", blank.what()));
        } else if is_by_value && longest_s > DROP_OUT_S {
            self.understood.notes.push(format!(
                "`blank` of the {quantity} empties {} s in one piece, where it may be the film's: name the times of drop-outs, as in \
                 {quantity}:12.5..13",
                rounded(longest_s)
            ));
        }
        Ok(emptied.len())
    }

    /// The same with `rows` other rows, made from all times and all cells of a column.
    fn with_rows(
        self,
        rows: usize,
        time: impl Fn(&[f64], usize) -> f64,
        cell: impl Fn(&[Option<f64>], usize) -> Option<f64>,
    ) -> Self {
        let clock_s = (0..rows).map(|row| time(&self.clock_s, row)).collect();
        let columns = self.columns.iter().map(|(quantity, column)| {
            (*quantity, column.with_cells((0..rows).map(|row| cell(column.cells(), row)).collect()))
        });
        Self { clock_s, columns: columns.collect(), understood: self.understood.clone() }
    }
}
