//! Kinds of files with columns: their columns, by the names that this tool writes or as laboratories have them.

use std::io::Read;
use std::path::Path;

use crate::error::Result;
use crate::files::bounded;
use crate::files::import::{self, Hints, Names, Quantity, Request, Series, Understood};
use crate::files::table::Table;

/// The columns that a kind of file has beside its times.
#[derive(Clone, Copy, Debug)]
pub struct Layout<const N: usize> {
    /// Kind of the file, as an error names it: "a CSV recording".
    pub what: &'static str,
    /// Quantity of each column, and the names that it has in a file of this tool.
    pub columns: [(Quantity, &'static Names); N],
    /// At least one column of every set must exist.
    pub needed: &'static [&'static [Quantity]],
}

/// Names of a column of times.
const TIME: &Names = &[("time_s", "s"), ("time_ms", "ms"), ("Time (s)", "s")];

impl<const N: usize> Layout<N> {
    /// Reads the file at `path`, of which a person says `hints`: one with the names of this tool, or any that
    /// [`crate::files::import`] understands.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::Error) naming the file and line of the first thing that cannot be used.
    pub fn read(&self, path: &Path, hints: &Hints) -> Result<(Table<N>, Understood)> {
        let file = bounded::open(path, self.what)?;
        let series = self.ask(|request| import::read(path, file, request, hints))?;
        Ok((self.table(&series), series.understood))
    }

    /// Reads CSV text with the names of this tool; `path` is what errors name.
    pub fn from_csv(&self, path: &Path, csv: impl Read) -> Result<(Table<N>, Understood)> {
        let series = self.ask(|request| import::from_csv(path, csv, request))?;
        Ok((self.table(&series), series.understood))
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

    /// Passes the columns that are wanted and needed to `read`.
    fn ask(&self, read: impl FnOnce(&Request<'_>) -> Result<Series>) -> Result<Series> {
        let wanted: Vec<_> = [(Quantity::Time, TIME)].into_iter().chain(self.columns).collect();
        let needed: Vec<&[Quantity]> = [[Quantity::Time].as_slice()].iter().chain(self.needed).copied().collect();
        read(&Request { wanted: &wanted, needed: &needed })
    }
}
