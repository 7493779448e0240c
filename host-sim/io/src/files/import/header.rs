//! The header above rows of numbers: preamble, names, units.

use super::Request;
use super::beginnings::Beginnings;
use super::factors::is_factor;
use super::interval::{self, Stated};
use super::lines::Fault;
use super::names::{Title, UnitSense, quantity, unit_cell};
use super::numbers::is_number;

/// A row above the numbers, or the first of them.
#[derive(Clone, Debug, PartialEq)]
pub struct TopRow {
    /// Its line in the file, from one.
    pub line: u64,
    /// Its cells.
    pub cells: Vec<String>,
    /// Whether it was a comment.
    pub comment: bool,
}

/// Lines above the numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Head {
    /// The columns' titles; empty where there is no header.
    pub titles: Vec<Title>,
    /// Line of the names; 0 without.
    pub line: u64,
    /// Rows above the names.
    pub preamble: usize,
    /// Interval of the rows that the preamble states.
    pub interval: Option<Stated>,
    /// Times at which channels begin.
    pub beginnings: Vec<Beginnings>,
    /// Line of a row between names and numbers that has gains or the like, which are not applied.
    pub gains: Option<u64>,
}

impl Head {
    /// The first title here that is another in `other`, and that one.
    pub fn differs(&self, other: &Self) -> Option<(String, String)> {
        let shown = |title: Option<&Title>| {
            let title = title.cloned().unwrap_or_default();
            let unit = title.unit.as_deref().map_or_else(String::new, |unit| format!(" {}", unit.trim()));
            format!("{:?}{unit}", title.name)
        };
        let count = self.titles.len().max(other.titles.len());
        let pairs = (0..count).map(|k| (shown(self.titles.get(k)), shown(other.titles.get(k))));
        pairs.into_iter().find(|(one, other)| one != other)
    }
}

/// Content of a row of a preamble.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Key {
    Names,
    Units,
    Gains,
}

/// The first cells of such rows, in small letters, with blanks for underlines, and commas between them.
const KEYS: &[(Key, &str)] = &[
    (
        Key::Names,
        "tracename, trace name, channelname, channel name, channel names, channeltitle, channel title, signal name",
    ),
    (Key::Units, "vunit, v unit, y unit label, y unit, y units, unit, units, unitname, unit name, einheit, einheiten"),
    (
        Key::Gains,
        "gain, gains, scale, scales, scaling, scale factor, factor, factors, faktor, skalierung, verstärkung, \
         sensitivity, empfindlichkeit, range, bereich, offset, offsets, calibration, slope, conversion, multiplier, min, \
         max, mean, zero",
    ),
];

fn key(cell: &str) -> Option<Key> {
    let name = cell.split(['(', '[', ':', '=']).next().unwrap_or_default().replace('_', " ").to_lowercase();
    KEYS.iter().find(|(_, names)| names.split(", ").any(|known| known == name.trim())).map(|(key, _)| *key)
}

/// Finds the header in the rows `above` the numbers, of which the first has `columns` cells. A person may say that the names are in line
/// `forced`.
/// A row between names and numbers that is neither is an error.
pub fn find(above: &[TopRow], columns: usize, forced: Option<u64>) -> Result<Head, Fault> {
    let rows: Vec<&TopRow> =
        above.iter().filter(|row| (!row.comment || forced == Some(row.line)) && !row.cells.is_empty()).collect();
    let with_key = |wanted: Key| rows.iter().rev().find(|row| key(&row.cells[0]) == Some(wanted)).copied();
    let mut head = Head::default();
    let (mut units, mut odd) = (None, None);
    let mut names = None;
    for (index, row) in rows.iter().enumerate().rev() {
        let filled = row.cells.iter().filter(|cell| !cell.trim().is_empty()).count();
        let is_numeric = row.cells.iter().any(|cell| is_number(cell));
        let key = key(&row.cells[0]);
        if forced == Some(row.line) {
            names = Some(index);
            break;
        }
        if units.is_none() && is_units(row, &rows[..index], columns) {
            units = Some((index, *row));
        } else if key == Some(Key::Gains) && is_numeric {
            head.gains = Some(row.line);
        } else if forced.is_some()
            || filled == 0
            || (filled == 1 && columns > 1)
            || is_rule(row)
            || key.is_some_and(|key| is_numeric || matches!(key, Key::Units | Key::Names))
            || (is_numeric && interval::is_named(&row.cells[0]))
        {
            // No names.
        } else if is_numeric {
            odd = odd.or(Some(*row));
        } else if row.cells.len() > 1 || columns == 1 {
            names = Some(index);
            break;
        }
    }
    if let (None, Some(line)) = (names, forced) {
        return Err((line, "`header_line`: no names in this line above the rows of numbers".into()));
    }
    // A line of names by its key counts more than a line above the numbers; units alone are names as well.
    if let Some(row) = with_key(Key::Names).filter(|_| forced.is_none()) {
        names = rows.iter().position(|other| other.line == row.line);
        (odd, head.gains) = (None, None);
    }
    if names.is_none()
        && let Some(uncommented) = uncommented(above, units.map(|(_, row)| row.line), columns)
    {
        return Ok(Head { preamble: 0, ..find(&uncommented, columns, None)? });
    }
    if let (None, Some((index, _))) = (names, units) {
        names = Some(index);
        units = None;
    }
    let Some(index) = names else {
        return Ok(Head { preamble: rows.len(), gains: None, ..head });
    };
    let row = rows[index];
    if let Some(odd) =
        odd.filter(|odd| odd.line > row.line && odd.cells.len() == row.cells.len() && row.cells.len() == columns)
    {
        let text = odd.cells.iter().find(|cell| !cell.is_empty() && !is_number(cell)).map_or("", String::as_str);
        let cause =
            format!("{text:?} is not a number here, and this row below the names has no units; correct or remove it");
        return Err((odd.line, cause));
    }
    let units = units.map(|(_, row)| row).or_else(|| with_key(Key::Units).filter(|row| row.cells.len() > 1));
    let is_key = |cell: &String| key(cell) == Some(Key::Units);
    let unit = |index: usize| {
        units.and_then(|units| units.cells.get(index)).filter(|unit| !unit.trim().is_empty() && !is_key(unit)).cloned()
    };
    // A key, or the numbers of the rows.
    let is_no_name = |index: usize, name: &str| {
        let counts = unit(index).is_some_and(|unit| unit.trim().eq_ignore_ascii_case("sequence"));
        counts || (index == 0 && key(name) == Some(Key::Names))
    };
    let title = |(k, name): (usize, &String)| {
        let name = if is_no_name(k, name) { "" } else { name.trim() };
        Title { unit: unit(k), ..Title::new(name) }
    };
    head.titles = row.cells.iter().enumerate().map(title).collect();
    if let Some(groups) = index.checked_sub(1).map(|above| rows[above]).filter(|groups| are_groups(groups, row)) {
        let mut group = "";
        for (k, title) in head.titles.iter_mut().enumerate() {
            // Cells of a spreadsheet that were merged have their text in the first one.
            group = groups.cells.get(k).map(|cell| cell.trim()).filter(|cell| !cell.is_empty()).unwrap_or(group);
            title.group = group.into();
        }
    }
    // Oscilloscopes put start and increment behind the names, and their values in the row of units.
    head.interval = interval::of_scope(&row.cells, units.map(|units| units.cells.as_slice())).map(Ok);
    let is_setting = |title: &Title| {
        let name = title.name.to_lowercase();
        matches!(name.as_str(), "start" | "increment")
            || name.split_once('=').is_some_and(|(name, _)| matches!(name.trim(), "t0" | "tinc"))
    };
    if head.interval.is_some() {
        for title in head.titles.iter_mut().filter(|title| is_setting(title)) {
            *title = Title::default();
        }
    }
    (head.line, head.preamble) = (row.line, index);
    let states = |above: &&TopRow| above.line < row.line && states_factor(&above.cells.join(" "));
    head.gains = head.gains.or_else(|| above.iter().find(states).map(|above| above.line));
    Ok(head)
}

/// Whether a `row` is a line between the names and the numbers: `---|:--:|---`.
fn is_rule(row: &TopRow) -> bool {
    row.cells.iter().all(|cell| cell.chars().all(|c| "-=_:+ ".contains(c)))
}

/// Whether the row above the `names` has groups of columns.
fn are_groups(groups: &TopRow, names: &TopRow) -> bool {
    let filled = groups.cells.iter().filter(|cell| !cell.trim().is_empty()).count();
    groups.cells.len() <= names.cells.len()
        && filled > 1
        && (groups.cells[0].trim().is_empty() || filled == names.cells.len())
        && names.cells.len() > 2
        && !groups.cells.iter().any(|cell| is_number(cell))
        && key(&groups.cells[0]).is_none()
}

/// The rows `above` numbers or a row of units in line `units`, with the comments that may be names, as numpy.savetxt writes them:
/// `# time_s voltage_v`. None without such comments.
fn uncommented(above: &[TopRow], units: Option<u64>, columns: usize) -> Option<Vec<TopRow>> {
    let may_name = |row: &TopRow| {
        row.cells.len() == columns
            && !row.cells.iter().any(|cell| is_number(cell))
            && units.is_none_or(|line| row.line < line)
    };
    above.iter().any(|row| row.comment && may_name(row)).then(|| {
        let rows = above.iter().filter(|row| !row.comment || may_name(row));
        rows.map(|row| TopRow { comment: false, ..row.clone() }).collect()
    })
}

/// Whether `row` is a row of units: there is nothing else in it, or below names at most as many other cells, which may be units as well.
/// There are at least two units where there are two columns. An oscilloscope's has settings too.
fn is_units(row: &TopRow, above: &[&TopRow], columns: usize) -> bool {
    let is_scope = row.cells[0].trim().eq_ignore_ascii_case("sequence");
    let (mut units, mut known, mut unknown) = (usize::from(is_scope), 0, 0);
    for cell in row.cells.iter().skip(usize::from(is_scope)).map(|cell| cell.trim()).filter(|cell| !cell.is_empty()) {
        let in_brackets = cell.starts_with(['(', '[', '{']) && cell.ends_with([')', ']', '}']);
        match unit_cell(cell, false) {
            UnitSense::Known(_) | UnitSense::MilliOrMega => units += 1,
            UnitSense::Other | UnitSense::Missing => known += 1,
            _ if in_brackets || (is_scope && is_number(cell)) => known += 1,
            _ if is_number(cell) => return false,
            _ => unknown += 1,
        }
    }
    let are_names = |names: &&TopRow| {
        let is_name = |(name, unit): (&String, &String)| unit.trim().is_empty() || !name.trim().is_empty();
        names.cells.len() == row.cells.len()
            && names.cells.iter().zip(&row.cells).all(is_name)
            && !names.cells.iter().any(|cell| is_number(cell))
            && key(&names.cells[0]).is_none()
            && !is_units(names, &[], columns)
    };
    units >= columns.min(2) && (unknown == 0 || (unknown <= units + known && above.iter().any(are_names)))
}

/// Whether a `line` above the names states the factor of what one of its words names: `HV divider 2000:1`, `Laser x10`.
fn states_factor(line: &str) -> bool {
    let is_ratio = |part: &str| match part.split_once(':') {
        Some(("1", other) | (other, "1")) => other.parse::<u32>().is_ok_and(|other| other > 1),
        _ => is_factor(&part.to_lowercase()),
    };
    let mut parts = line.split(|c: char| c.is_whitespace() || "()[],;=".contains(c));
    parts.any(is_ratio) && quantity(line, &Request { wanted: &[], needed: &[] }).is_some()
}
