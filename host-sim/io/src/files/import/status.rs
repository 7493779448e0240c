//! Columns that say of a few rows that something was wrong, or that the gain of an instrument changed.

use super::numbers::Cell;
use super::reading::Reading;
use super::source::Source;
use super::words::has_word;

/// Words for what is wrong, and beginnings of them of four letters and more.
const FAULTS: &str = "err bad nok ng fail fault invalid alarm overrange overflow overload overld ovld saturat timeout lost questionable uncertain \
    suspect fehler ungültig störung erreur invalide défaut inválid fallo errore guasto";
/// A status is that of this part of the rows at most; more of them are a matter of the whole file.
const MAX_PART: f64 = 0.5;

/// Words for the size of a reading in the name of a column. Not ranges: an instrument that chooses its range accounts for it.
const GAINS: &str = "gain sensitivity scale scaling factor verstärkung empfindlichkeit sensibilité ganancia escala \
    guadagno scala";

/// Remarks on columns that are not read: rows that are faulty by them, and changes of the gain.
pub fn remarks(reading: Reading<'_>) -> Vec<String> {
    let Reading { source, titles, .. } = reading;
    let is_seen = |index: &usize| titles[*index].text || is_gain(&titles[*index].name);
    let indices: Vec<usize> = reading.others().into_iter().filter(is_seen).collect();
    let of_column = |index: &usize| Found { is_gain: is_gain(&titles[*index].name), ..Found::default() };
    let mut found: Vec<Found> = indices.iter().map(of_column).collect();
    let mut rows = 0;
    if indices.is_empty() || matches!(source, Source::Series(_)) {
        return Vec::new();
    }
    // The rows were read before.
    let _ = source.each(&indices, |line, values| {
        rows += 1;
        for (found, value) in found.iter_mut().zip(values) {
            found.see(line, *value);
        }
        Ok(())
    });
    indices.iter().zip(found).flat_map(|(index, found)| found.remarks(&titles[*index].name, rows)).collect()
}

/// Cells of a column.
#[derive(Clone, Debug, Default)]
struct Found {
    /// Whether they are gains.
    is_gain: bool,
    /// The line of the first fault, the text, and how many there are.
    fault: Option<(u64, String)>,
    faults: usize,
    /// The last cell, and the line and the two cells of the first change.
    last: Option<String>,
    change: Option<(u64, [String; 2])>,
}

impl Found {
    fn see(&mut self, line: u64, value: Cell<'_>) {
        let begin = |text: &str| text.trim().chars().take(40).collect::<String>();
        let fault = match value {
            Cell::Text(text) if is_fault(text) => Some(format!("{:?}", begin(text))),
            Cell::OutOfRange => Some("an error".into()),
            _ => None,
        };
        if let Some(fault) = fault {
            self.faults += 1;
            self.fault.get_or_insert((line, fault));
            return;
        }
        let shown = match value {
            Cell::Text(text) if self.is_gain => begin(text),
            Cell::Number(number) if self.is_gain => number.to_string(),
            _ => return,
        };
        if self.last.as_ref() != Some(&shown)
            && let Some(last) = self.last.replace(shown.clone())
        {
            self.change.get_or_insert((line, [last, shown]));
        }
    }

    fn remarks(self, name: &str, rows: u32) -> impl Iterator<Item = String> {
        let change = self.change.map(|(line, [before, after])| {
            format!(
                "{name:?} changes from {before} to {after} in line {line}, and the readings are used as they are; if they do not have one unit on \
                 both sides of it, import them as two files"
            )
        });
        let count = self.faults;
        let fault = self.fault.filter(|_| (count as f64) < MAX_PART * f64::from(rows)).map(|(line, text)| {
            format!(
                "{name:?} says {text} in {count} rows, the first in line {line}, whose readings are used; if they are not valid, leave their cells \
                 empty or use `blank`"
            )
        });
        change.into_iter().chain(fault)
    }
}

fn is_gain(name: &str) -> bool {
    // The force scale of a controller's log is that of its law, not of an instrument.
    name != "force_scale" && has_word(GAINS, name)
}

fn is_fault(text: &str) -> bool {
    let lower = text.to_lowercase();
    let is_fault = |word: &str| {
        FAULTS.split(' ').any(|fault| {
            word == fault || word.strip_suffix("or") == Some(fault) || (fault.len() > 3 && word.starts_with(fault))
        })
    };
    lower.split(|c: char| !c.is_alphanumeric()).any(is_fault)
}
