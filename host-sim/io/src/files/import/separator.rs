//! Separators of cells.

use memchr::{memchr2, memchr3};

/// Separator of the cells of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    /// Tab stops.
    Tab,
    /// Semicolons.
    Semicolon,
    /// Commas.
    Comma,
    /// Vertical bars.
    Bar,
    /// Blanks, any number of them.
    Blanks,
}

impl Separator {
    /// In their order; blanks occur beside other separators as well.
    pub(super) const ALL: [Self; 5] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Bar, Self::Blanks];

    fn name_and_sign(self) -> (&'static str, &'static str) {
        match self {
            Self::Tab => ("tabs", "\t"),
            Self::Semicolon => ("semicolons", ";"),
            Self::Comma => ("commas", ","),
            Self::Bar => ("vertical bars", "|"),
            Self::Blanks => ("blanks", " "),
        }
    }

    /// For a sentence: separated by …
    pub fn name(self) -> &'static str {
        self.name_and_sign().0
    }

    pub(super) fn sign(self) -> &'static str {
        self.name_and_sign().1
    }

    /// The first separator or quote in `text`.
    fn find(self, text: &[u8]) -> Option<usize> {
        match self {
            Self::Blanks => memchr3(b' ', b'\t', b'"', text),
            _ => memchr2(self.sign().as_bytes()[0], b'"', text),
        }
    }

    /// The cells of `line`, without the quotes around them.
    pub fn split(self, line: &str) -> Vec<&str> {
        self.cells(line).0
    }

    /// The cells of `line`, and whether the last has a quote that is not closed. A quote inside a cell is a letter; one that begins a
    /// cell holds separators in it.
    pub(super) fn cells(self, line: &str) -> (Vec<&str>, bool) {
        let mut cells = Vec::new();
        let line = if self == Self::Blanks { line.trim() } else { line };
        let (mut start, mut next, mut quoted) = (0, 0, false);
        while let Some(distance) = self.find(&line.as_bytes()[next..]) {
            let at = next + distance;
            next = at + 1;
            if line.as_bytes()[at] == b'"' {
                // Two quotes in a quoted cell are a letter: the second opens it again.
                let opens = line[start..at].trim_start();
                quoted = !quoted && (matches!(opens, "" | "=") || opens.ends_with('"'));
            } else if !quoted {
                cells.push(bare(&line[start..at]));
                start = next;
            }
        }
        cells.push(bare(&line[start..]));
        if self == Self::Blanks {
            cells.retain(|cell| !cell.is_empty());
        }
        (cells, quoted)
    }
}

/// `cell` without blanks and quotes around it, also those that keep a spreadsheet from changing it: `="0.01"`.
pub(super) fn bare(cell: &str) -> &str {
    let is_bare = |end: Option<&u8>| end.is_some_and(|byte| byte.is_ascii_graphic() && !b"\"'".contains(byte));
    if is_bare(cell.as_bytes().first()) && is_bare(cell.as_bytes().last()) {
        return cell;
    }
    let cell = cell.trim();
    let quoted = cell.strip_prefix('=').filter(|text| text.starts_with('"')).unwrap_or(cell);
    let inside = |quote: char| quoted.strip_prefix(quote)?.strip_suffix(quote);
    inside('"').or_else(|| inside('\'')).map_or(cell, str::trim)
}
