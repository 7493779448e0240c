//! Tables of README.md, docs/*.md and firmware/README.md, for the checks that compare their numbers with measured ones.
//!
//! A row is found by its first cell, a number by the title of its column.
#![forbid(unsafe_code)]

pub mod words;

use std::fs;
use std::path::{Path, PathBuf};

/// The root of the project.
#[must_use]
pub fn root() -> &'static Path {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here)
}

/// README.md, docs/*.md in the order of their names, and those README.md of the firmware and of springpot.
///
/// # Errors
/// The folder cannot be read.
pub fn files() -> Result<Vec<PathBuf>, String> {
    let folder = root().join("docs");
    let entries = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    files.sort();
    files.insert(0, root().join("README.md"));
    files.push(root().join("firmware/README.md"));
    files.push(root().join("crates/springpot/README.md"));
    Ok(files)
}

/// A table in Markdown.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Titles of the columns, as in the file.
    pub header: Vec<String>,
    /// Cells of the rows, as in the file; a row may lack cells.
    pub rows: Vec<Vec<String>>,
    /// File and line of the header, `README.md:70`.
    pub place: String,
}

/// All tables of all documents.
#[derive(Clone, Debug)]
pub struct Documents {
    tables: Vec<Table>,
}

/// How far a measured number may be from a stated one.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Share of the stated number.
    pub relative: f64,
    /// Added to that, for numbers that are stated with few digits.
    pub absolute: f64,
}

impl Tolerance {
    /// 2 %: counts and sizes, which another version of the compiler may change a little.
    pub const COUNT: Self = Self { relative: 0.02, absolute: 0.0 };

    /// Whether `measured` is close enough to `stated`.
    #[must_use]
    pub fn holds(self, measured: f64, stated: f64) -> bool {
        (measured - stated).abs() <= self.relative * stated.abs() + self.absolute
    }
}

impl Documents {
    /// Reads [`files`].
    ///
    /// # Errors
    /// One of them cannot be read.
    pub fn read() -> Result<Self, String> {
        let mut tables = Vec::new();
        for path in files()? {
            let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
            let name = path.strip_prefix(root()).unwrap_or(&path).display().to_string();
            tables.extend(tables_of(&name, &text));
        }
        Ok(Self { tables })
    }

    /// The tables of one text; `name` is what their places say.
    #[must_use]
    pub fn from_text(name: &str, text: &str) -> Self {
        Self { tables: tables_of(name, text) }
    }

    /// The tables, file by file.
    #[must_use]
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }

    /// The number in the column whose title begins with `column`, of the first row whose first cells are `row`. A name in
    /// code font or bold counts as the bare name. `None` where the row, the column or a number in that cell is missing.
    #[must_use]
    pub fn number(&self, row: &[&str], column: &str) -> Option<f64> {
        self.tables.iter().find_map(|table| {
            let index = table.column(column)?;
            let found = table.rows.iter().find(|cells| {
                cells.len() >= row.len() && cells.iter().zip(row).all(|(cell, name)| bare(cell) == *name)
            })?;
            number(found.get(index)?)
        })
    }

    /// First cell and number of every row that has a name in code font and a number in the column whose title begins with
    /// `column`.
    #[must_use]
    pub fn column(&self, column: &str) -> Vec<(&str, f64)> {
        self.tables
            .iter()
            .filter_map(|table| Some((table, table.column(column)?)))
            .flat_map(|(table, index)| table.rows.iter().map(move |cells| (cells, index)))
            .filter(|(cells, _)| cells[0].starts_with('`'))
            .filter_map(|(cells, index)| Some((bare(&cells[0]), number(cells.get(index)?)?)))
            .collect()
    }
}

impl Table {
    fn column(&self, title: &str) -> Option<usize> {
        self.header.iter().position(|cell| bare(cell).starts_with(title))
    }
}

/// A cell without code font and bold.
fn bare(cell: &str) -> &str {
    cell.trim_matches(['`', '*'])
}

/// The number that a cell begins with. Its digits may be in groups of three.
fn number(cell: &str) -> Option<f64> {
    let cell = bare(cell);
    let end = cell.find(|c: char| !(c.is_ascii_digit() || " .+-e".contains(c))).unwrap_or(cell.len());
    let digits: String = cell[..end].trim_end_matches([' ', '.', 'e', '+', '-']).split(' ').collect();
    digits.parse().ok()
}

/// Tables of one document. Text between code fences is not a table.
fn tables_of(name: &str, text: &str) -> Vec<Table> {
    let mut tables: Vec<Table> = Vec::new();
    let (mut fenced, mut inside) = (false, false);
    for (index, line) in text.lines().enumerate() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        }
        let Some(cells) = cells(line).filter(|_| !fenced) else {
            inside = false;
            continue;
        };
        match tables.last_mut() {
            Some(table) if inside => table.rows.push(cells),
            _ => tables.push(Table { header: cells, rows: Vec::new(), place: format!("{name}:{}", index + 1) }),
        }
        inside = true;
    }
    for table in &mut tables {
        // The line below the header is dashes.
        if table.rows.first().is_some_and(|cells| cells.iter().all(|cell| cell.starts_with(['-', ':']))) {
            table.rows.remove(0);
        }
    }
    tables
}

/// The cells of a row. A bar after a backslash belongs to its cell.
fn cells(line: &str) -> Option<Vec<String>> {
    let row = line.trim().strip_prefix('|')?;
    let row = row.strip_suffix('|').filter(|row| !row.ends_with('\\')).unwrap_or(row);
    let mut cells = vec![String::new()];
    let mut escaped = false;
    for c in row.chars() {
        if c == '|' && !escaped {
            cells.push(String::new());
        } else if let Some(cell) = cells.last_mut() {
            cell.push(c);
        }
        escaped = c == '\\';
    }
    Some(cells.into_iter().map(|cell| cell.trim().to_owned()).collect())
}
