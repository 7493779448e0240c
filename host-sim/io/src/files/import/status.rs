//! Columns of texts that say of a few rows that something was wrong.

use super::chosen::Chosen;
use super::names::Title;
use super::source::{Source, Value};

/// Words for what is wrong, and beginnings of them of four letters and more.
const FAULTS: &str = "err bad nok ng fail fault invalid alarm overrange overflow overload overld ovld saturat timeout lost questionable uncertain \
    suspect fehler ungültig störung erreur invalide défaut inválid fallo errore guasto";
/// A status is that of this part of the rows at most; more of them are a matter of the whole file.
const MAX_PART: f64 = 0.5;

/// Remarks on the rows of which a column that is not `chosen` says that they are faulty.
pub fn remarks(source: &Source<'_>, chosen: &[Chosen], titles: &[Title]) -> Vec<String> {
    let is_unused = |index: &usize| titles[*index].text && chosen.iter().all(|column| column.index != *index);
    let indices: Vec<usize> = (0..titles.len()).filter(is_unused).collect();
    let mut found: Vec<Option<(usize, u64, String)>> = vec![None; indices.len()];
    let mut rows = 0;
    if indices.is_empty() || matches!(source, Source::Series(_)) {
        return Vec::new();
    }
    // The rows were read before.
    let _ = source.each(&indices, |line, values| {
        rows += 1;
        for (found, value) in found.iter_mut().zip(values) {
            let shown = match value {
                Value::Text(text) if is_fault(text) => format!("{:?}", text.chars().take(40).collect::<String>()),
                Value::OutOfRange => "an error".into(),
                _ => continue,
            };
            found.get_or_insert((0, line, shown)).0 += 1;
        }
        Ok(())
    });
    let note = |(index, found): (&usize, Option<(usize, u64, String)>)| {
        let (count, line, text) = found.filter(|(count, ..)| (*count as f64) < MAX_PART * f64::from(rows))?;
        Some(format!(
            "{:?} says {text} in {count} rows, the first in line {line}, whose readings are used; if they are not valid, leave their cells empty or use \
             `blank`",
            titles[*index].name
        ))
    };
    indices.iter().zip(found).filter_map(note).collect()
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
