//! Files that have a row for each channel in place of a column: their rows are not readings of one quantity.

use std::collections::BTreeSet;

use super::clock;
use super::lines::Fault;
use super::names::Title;
use super::numbers::Cell;
use super::reading::Reading;
use super::words::is_of;

/// Words of titles of columns that number the channels of their rows, and of those that may do so within the rows of one time.
const CHANNEL: &str = "channel chan ch kanal canal canale voie 通道 チャンネル";
const SOURCE: &str = "probe sensor signal id port device axis input mux film module node actuator dut unit head cell scan slot \
    address electrode no nr number";
/// Most channels of a logger.
const MAX_CHANNELS: usize = 64;

/// Texts, or whole numbers that may be those of channels, in one column.
#[derive(Default)]
struct Texts {
    /// Whether its whole numbers count, and whether its title says that they are of channels.
    may_number: bool,
    is_channel: bool,
    has_fractions: bool,
    different: BTreeSet<String>,
    /// Line of the second one of them.
    line: u64,
    /// The first one of this time, the times at which another one followed, and the last of these.
    first: Option<String>,
    times: usize,
    last: usize,
}

impl Texts {
    fn new(title: &Title) -> Self {
        let name = title.name.to_lowercase();
        let words = || name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
        let is_channel = words().any(|word| is_of(CHANNEL, word));
        // `Channel A` is a channel.
        let may_number = !title.increases
            && words().next().is_some()
            && words().all(|word| is_of(CHANNEL, word) || is_of(SOURCE, word));
        Self { may_number, is_channel: is_channel && may_number, ..Self::default() }
    }

    fn take(&mut self, line: u64, value: Cell<'_>, begins: bool, repeated: usize) {
        let text = match value {
            Cell::Text(text) if clock::stamp(text).is_none() => Some(text.to_owned()),
            Cell::Number(number) if self.may_number => {
                self.has_fractions |= number.fract() != 0.0;
                Some(number.to_string())
            }
            _ => None,
        };
        if let Some(text) = text.as_ref().filter(|_| self.different.len() <= MAX_CHANNELS)
            && self.different.insert(text.clone())
            && self.different.len() == 2
        {
            self.line = line;
        }
        if begins {
            self.first = text;
        } else if let (Some(first), Some(text)) = (&self.first, text)
            && *first != text
            && self.last != repeated
        {
            (self.times, self.last) = (self.times + 1, repeated);
        }
    }

    /// Why they are names of channels, after `repeated` times of several rows.
    fn names_channels(&self, repeated: usize) -> Option<&'static str> {
        let is_few = !self.may_number || self.different.len() <= MAX_CHANNELS && !self.has_fractions;
        match is_few {
            true if repeated > 0 && self.times == repeated => Some(" within the rows of one time"),
            true if self.is_channel && self.different.len() > 1 => Some(""),
            _ => None,
        }
    }
}

/// Refuses a column that is not read and names the channel of its row: by its title, or, where rows of one time `may_repeat` it, by its texts
/// that change within the rows of each time.
pub fn refuse(reading: Reading<'_>, may_repeat: bool) -> Result<(), Fault> {
    let Reading { source, titles, .. } = reading;
    let time = reading.time().filter(|_| may_repeat).map(|time| time.index);
    let columns = reading.others().into_iter().map(|index| (index, Texts::new(&titles[index])));
    let mut columns: Vec<(usize, Texts)> = columns.filter(|(_, texts)| time.is_some() || texts.is_channel).collect();
    if columns.is_empty() {
        return Ok(());
    }
    let indices: Vec<usize> = columns.iter().map(|(index, _)| *index).chain(time).collect();
    let (mut now, mut rows, mut repeated) = (String::new(), 0, 0);
    source.each(&indices, |line, values| {
        let (values, time) = values.split_at(columns.len());
        let key = time.first().map_or_else(|| line.to_string(), |time| format!("{time:?}"));
        rows = if key == now { rows + 1 } else { 1 };
        repeated += usize::from(rows == 2);
        now = key;
        for ((_, texts), value) in columns.iter_mut().zip(values) {
            texts.take(line, *value, rows == 1, repeated);
        }
        Ok(())
    })?;
    let named = columns.iter().find_map(|(index, texts)| Some((*index, texts, texts.names_channels(repeated)?)));
    let Some((index, texts, within)) = named else { return Ok(()) };
    let shown: Vec<String> = texts.different.iter().take(2).map(|text| format!("{text:?}")).collect();
    let (name, shown) = (&titles[index].name, shown.join(", "));
    let cause = "it names the channel of its row; write each channel as a column of its own";
    Err((texts.line, format!("{name:?} changes{within} ({shown}): {cause}")))
}
