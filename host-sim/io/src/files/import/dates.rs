//! Dates and days in a column of their own, beside times that do not have them.

use super::chosen::{By, Chosen};
use super::clock::{self, DAY_S};
use super::lines::Fault;
use super::numbers::Cell;
use super::reading::Reading;
use super::words::has_word;

/// Words for dates, whose cells are dates or whole numbers, and for days, whose cells are these or count them.
const DATES: &str = "date datum fecha data дата 日期 日付";
const DAYS: &str = "day tag jour día dia giorno dag день";
/// Seconds that elapsed are below, and those since 1970 above.
const MAX_ELAPSED_S: f64 = 1e8;
/// A pause in the times is this long at least, s.
const MIN_PAUSE_S: f64 = 3600.0;
/// Part of a day by which changes of the date may be more or less than days apart.
const MAX_ERROR: f64 = 0.01;

/// The number of a day, by the order of the parts of its date.
type Day = [Option<f64>; 3];

/// A row's time of day, or the seconds that elapsed.
#[derive(Clone, Copy)]
enum Time {
    OfDay(f64),
    Elapsed(f64),
}

/// The dates of a column as they change.
#[derive(Default)]
struct Days {
    before: Option<(Day, Time)>,
    /// Days since the first row.
    days: f64,
    /// Line, elapsed time and days of the last change without a pause in the times, and how many there are.
    change: Option<(u64, f64, f64)>,
    changes: usize,
    /// Line of the first change that the times do not have.
    fault: Option<u64>,
}

impl Days {
    fn take(&mut self, line: u64, day: Day, time: Time) {
        if let Some((before, earlier)) = self.before.filter(|(before, _)| *before != day) {
            let steps = day.iter().zip(before).filter_map(|(day, before)| Some((*day)? - before?));
            let days = steps.filter(|days| *days >= 0.0).reduce(f64::min).unwrap_or(-1.0);
            // A day of the month begins again with the first.
            let is_next =
                days == 1.0 || (day[0] == Some(1.0) && before[0].is_some_and(|day| (28.0..=31.0).contains(&day)));
            self.days += days;
            let fits = match (earlier, time) {
                (Time::OfDay(earlier), Time::OfDay(now)) => is_next && earlier - now > DAY_S / 2.0,
                (Time::Elapsed(earlier), Time::Elapsed(now)) if now - earlier <= MIN_PAUSE_S => {
                    self.changes += 1;
                    let last = self.change.replace((line, now, self.days));
                    last.is_none_or(|(_, last, days)| ((now - last) / DAY_S - self.days + days).abs() < MAX_ERROR)
                }
                _ => true,
            };
            if !fits {
                self.fault = self.fault.or(Some(line));
            }
        }
        self.before = Some((day, time));
    }

    /// The line of a change that may be behind a pause. One alone beside elapsed times may be that or a midnight.
    fn fault(&self) -> Option<u64> {
        self.fault.or(self.change.filter(|_| self.changes == 1).map(|(line, ..)| line))
    }
}

/// Refuses a column that is not read whose date changes where the times in the column `time` do not pass midnight.
pub fn refuse(reading: Reading<'_>, time: &Chosen) -> Result<(), Fault> {
    let Reading { source, titles, .. } = reading;
    // A person who chose them knows the times.
    if time.by == By::Choice {
        return Ok(());
    }
    let is_date = |index: &usize| [DATES, DAYS].iter().any(|words| has_word(words, &titles[*index].name));
    let Some(index) = reading.others().into_iter().find(is_date) else { return Ok(()) };
    let mut days = Days::default();
    // A row that cannot be read is found later; a column of other texts is no date.
    let all = source.each(&[time.index, index], |line, values| {
        let now = match values[0] {
            Cell::Number(number) if (number * time.factor).abs() < MAX_ELAPSED_S => Time::Elapsed(number * time.factor),
            Cell::Text(text) => match clock::stamp(text) {
                Some(stamp) if stamp.days().is_none() => Time::OfDay(stamp.of_day_s),
                _ => return Err(String::new()),
            },
            Cell::Number(_) => return Err(String::new()),
            _ => return Ok(()),
        };
        match values[1] {
            Cell::Nothing | Cell::Ended => {}
            value => days.take(line, day(value).ok_or_else(String::new)?, now),
        }
        Ok(())
    });
    let Some(line) = days.fault().filter(|_| all.is_ok()) else { return Ok(()) };
    let cause = format!(
        "{:?} changes here, where the times in {:?} do not show midnight: there may be a pause before this row that they do not have; join both \
         to one column, as in 2026-11-24 10:00:01, or choose the times with `columns` time={} if there was none",
        titles[index].name,
        time.name(titles),
        time.index + 1
    );
    Err((line, cause))
}

/// The number of a day: of a date without a time of day, or a whole number.
fn day(value: Cell<'_>) -> Option<Day> {
    match value {
        Cell::Number(number) => Some([Some(number); 3]).filter(|_| number.fract() == 0.0),
        Cell::Text(text) if text.starts_with('@') => clock::stamp(text).filter(|stamp| stamp.of_day_s == 0.0)?.days(),
        Cell::Text(text) => clock::stamp(&format!("{text} 00:00:00"))?.days(),
        _ => None,
    }
}
