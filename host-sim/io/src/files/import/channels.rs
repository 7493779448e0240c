//! Files that have a row for each channel in place of a column: rows of one time are then not readings of one quantity.

use std::collections::BTreeSet;

use super::clock;
use super::names::Title;
use super::source::{Source, Value};

/// Texts of one column within the rows of one time.
#[derive(Clone, Debug, Default)]
struct Texts {
    first: Option<String>,
    /// Times at which another one followed, and the last of these.
    times: usize,
    last: usize,
    /// Two texts of one time.
    example: [String; 2],
    /// Different numbers, up to more than there are channels.
    numbers: BTreeSet<u64>,
}

/// Most channels of a logger.
const MAX_CHANNELS: usize = 64;

/// Names of columns that number the channels of their rows, and that may do so.
const CHANNEL: &str = "channel chan ch kanal canal canale voie 通道 チャンネル";
const SOURCE: &str = "probe sensor signal id port device axis input mux film module node actuator dut unit head cell scan slot \
    address electrode no";

/// Refuses a column of texts, or of numbers of channels, at one of the `others` that changes within the rows of each time, which column `time`
/// repeats.
///
/// # Errors
///
/// The column, two of its texts and what to do.
pub fn refuse_names_in_rows(
    source: &Source<'_>,
    titles: &[Title],
    time: usize,
    others: &[usize],
) -> Result<(), (u64, String)> {
    if matches!(source, Source::Series(_)) {
        return Ok(());
    }
    let indices: Vec<usize> = [time].into_iter().chain(others.iter().copied()).collect();
    let numbers_channels = |index: &usize| {
        let Title { name, increases, .. } = &titles[*index];
        !increases && (says(name, CHANNEL) || says(name, SOURCE))
    };
    let numbers: Vec<bool> = others.iter().map(numbers_channels).collect();
    let mut columns = vec![Texts::default(); others.len()];
    let (mut now, mut rows, mut repeated) = (String::new(), 0, 0);
    source.each(&indices, |_, values| {
        let key = format!("{:?}", values[0]);
        rows = if key == now { rows + 1 } else { 1 };
        repeated += usize::from(rows == 2);
        now = key;
        for ((column, numbers), value) in columns.iter_mut().zip(&numbers).zip(&values[1..]) {
            let text = match value {
                Value::Text(text) if clock::stamp(text).is_none() => Some((*text).to_owned()),
                Value::Number(number) if *numbers && number.fract() == 0.0 => {
                    if column.numbers.len() <= MAX_CHANNELS {
                        column.numbers.insert(number.to_bits());
                    }
                    Some(number.to_string())
                }
                _ => None,
            };
            if rows == 1 {
                column.first = text;
            } else if let (Some(first), Some(text)) = (&column.first, text)
                && *first != text
                && column.last != repeated
            {
                (column.times, column.last) = (column.times + 1, repeated);
                column.example = [first.clone(), text];
            }
        }
        Ok(())
    })?;
    let is_few = |column: &Texts| column.numbers.len() <= MAX_CHANNELS;
    let is_name = |column: &Texts| repeated > 0 && column.times == repeated && is_few(column);
    match columns.iter().zip(others).find(|(column, _)| is_name(column)) {
        Some((Texts { example: [one, other], .. }, &index)) => Err((
            source.starts().first().copied().unwrap_or(0),
            format!(
                "{:?} changes within the rows of one time ({one:?}, {other:?}): it names the channel of its row; write each channel as a \
                 column of its own",
                titles[index].name
            ),
        )),
        None => Ok(()),
    }
}

fn says(name: &str, known: &str) -> bool {
    let name = name.to_lowercase();
    let mut words = name.split(|c: char| !c.is_alphanumeric());
    words.any(|word| known.split(' ').any(|known| known == word))
}

/// Refuses rows of several channels, each with times of its own, that a column at one of the `others` names.
///
/// # Errors
///
/// The column, two of its texts and what to do.
pub fn refuse_channels(source: &Source<'_>, titles: &[Title], others: &[usize]) -> Result<(), (u64, String)> {
    let named: Vec<usize> = others.iter().copied().filter(|index| says(&titles[*index].name, CHANNEL)).collect();
    if named.is_empty() {
        return Ok(());
    }
    let mut first: Vec<Option<String>> = vec![None; named.len()];
    source.each(&named, |_, values| {
        for ((first, value), index) in first.iter_mut().zip(values).zip(&named) {
            let text = match value {
                Value::Text(text) => (*text).to_owned(),
                Value::Number(number) if number.fract() == 0.0 => number.to_string(),
                _ => continue,
            };
            if *first.get_or_insert_with(|| text.clone()) != text {
                let name = &titles[*index].name;
                return Err(format!(
                    "{name:?} changes, from {:?} to {text:?}: it names the channel of its row; write each channel as a column of its own",
                    first.as_deref().unwrap_or_default()
                ));
            }
        }
        Ok(())
    })
}
