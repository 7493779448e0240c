//! Interpretation of a file of columns: by the names that this tool writes, or as laboratories have it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::files::csv::{self, Names, Table};
use crate::files::import::{self, Hints, Quantity, Request, Series, Understood};

/// The columns that a kind of file has beside its times.
#[derive(Clone, Copy, Debug)]
pub struct Layout<const N: usize> {
    /// Kind of the file, as an error names it: "a CSV recording".
    pub what: &'static str,
    /// Quantity of each column, and the names that it has in a file of this tool.
    pub columns: [(Quantity, &'static Names); N],
    /// At least one column of every set must exist.
    pub needed: &'static [&'static [usize]],
}

impl<const N: usize> Layout<N> {
    /// Reads the file at `path`, of which a person says `hints`: one with the names of this tool, or any that
    /// [`crate::files::import`] understands; then it comes with what was understood.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn read(&self, path: &Path, hints: &Hints) -> Result<(Table<N>, Option<Understood>)> {
        const HEAD: u64 = 1 << 16;
        if path.is_dir() {
            return Err(Error::file(path, format!("is a directory; name {} in it", self.what)));
        }
        let fault = |error: std::io::Error| Error::file(path, error);
        let mut rest = File::open(path).map_err(fault)?;
        let mut head = Vec::new();
        rest.by_ref().take(HEAD).read_to_end(&mut head).map_err(fault)?;
        if *hints == Hints::default() && csv::has_names(&head, self.names(), self.needed) {
            return Ok((self.from_csv(path, head.chain(rest))?, None));
        }
        let wanted: Vec<Quantity> =
            [Quantity::Time].into_iter().chain(self.columns.map(|(quantity, _)| quantity)).collect();
        let sets: Vec<Vec<Quantity>> =
            self.needed.iter().map(|set| set.iter().map(|&index| self.columns[index].0).collect()).collect();
        let needed: Vec<&[Quantity]> =
            [[Quantity::Time].as_slice()].into_iter().chain(sets.iter().map(Vec::as_slice)).collect();
        let request = Request { wanted: &wanted, needed: &needed };
        let series = import::read(path, &head, rest, &request, hints)?;
        let table = self.table(&series);
        Ok((table, Some(series.understood)))
    }

    /// Reads CSV text with the names of this tool; `path` is what errors name.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn from_csv(&self, path: &Path, csv: impl Read) -> Result<Table<N>> {
        Table::from_csv(path, csv, self.names(), self.needed)
    }

    /// The columns of `series`, time from the first row.
    pub fn table(&self, series: &Series) -> Table<N> {
        let start_s = series.clock_s.first().copied().unwrap_or(0.0);
        Table {
            time_s: series.clock_s.iter().map(|t| t - start_s).collect(),
            start_s,
            columns: self.columns.map(|(quantity, _)| series.column(quantity).cloned()),
        }
    }

    fn names(&self) -> [&'static Names; N] {
        self.columns.map(|(_, names)| names)
    }
}
