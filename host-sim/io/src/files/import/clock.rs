//! Times of day and dates in the cells of a column of times.

use super::numbers::all_digits;

/// Seconds of a day.
pub const DAY_S: f64 = 86400.0;

/// A time of day, with its date if the cell has one.
#[derive(Clone, Debug, PartialEq)]
pub struct Stamp {
    /// Since midnight, s.
    pub of_day_s: f64,
    date: Option<Date>,
}

/// A date as it may be read: days since a day that is the same for all, by the order of the parts: day first, month first, and year first.
type Date = [Option<i64>; 3];

impl Stamp {
    /// Whether it is a whole second.
    pub fn is_whole(&self) -> bool {
        self.of_day_s.fract() == 0.0
    }

    /// The number of its day by each order of the parts of its date, if it has one.
    pub fn days(&self) -> Option<[Option<f64>; 3]> {
        Some(self.date?.map(|days| Some(days? as f64)))
    }
}

/// Reads `text` as `10:00:01.5`, `10:00:01:500`, `10:00:01 PM`, `00:01.5` or with a date before it or behind it, as `2026-11-24T10:00:01Z`,
/// `20261124T100001` or `24.11.2026 10:00:01 UTC`.
pub fn stamp(text: &str) -> Option<Stamp> {
    let text = text.trim();
    if let Some((days, seconds)) = text.strip_prefix('@').and_then(|cell| cell.split_once(' ')) {
        // A cell of a spreadsheet that is a date, or a time of day alone: the 0th day.
        let date = Some(days.parse().ok()?).filter(|days| *days != 0).map(|days| [Some(days); 3]);
        return Some(Stamp { of_day_s: seconds.parse().ok()?, date });
    }
    if let Some(spaced) = spaced(text) {
        return stamp(&spaced);
    }
    let colon = text.find(':')?;
    let start = text[..colon]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| at + text[at..].chars().next().map_or(1, char::len_utf8));
    let (before, time) = text.split_at(start);
    let before = before.trim_end_matches(['T', 't', ' ', ',', ';', '-', '\u{a0}', '\u{202f}']).trim();
    // Numbers of days, as durations are written.
    let elapsed = before.strip_suffix("days").or_else(|| before.strip_suffix("day")).map(|days| days.trim().parse());
    let date = match elapsed {
        _ if before.is_empty() => None,
        Some(days) => Some([Some(days.ok()?); 3]),
        None => Some(date(before)?),
    };
    let (time, date) = match time.split_once(' ').and_then(|(time, after)| Some((time, self::date(after)?))) {
        Some((time, after)) if date.is_none() => (time, Some(after)),
        _ => (time, date),
    };
    Some(Stamp { of_day_s: of_day(time)?, date })
}

/// `20261124T100001.5` with the signs between its parts.
fn spaced(text: &str) -> Option<String> {
    let (date, time) = text.split_once(['T', 't'])?;
    let whole = time.find(|c: char| !c.is_ascii_digit()).unwrap_or(time.len());
    let is_compact = date.len() == 8 && all_digits(date) && whole == 6;
    let part = |text: &str, at: std::ops::Range<usize>| text[at].to_owned();
    is_compact.then(|| {
        let date = [part(date, 0..4), part(date, 4..6), part(date, 6..8)].join("-");
        format!("{date} {}", [part(time, 0..2), part(time, 2..4), part(time, 4..time.len())].join(":"))
    })
}

/// Whether `text` is a time of day, if perhaps one that can be read in two ways.
pub fn is_clock(text: &str) -> bool {
    stamp(text).is_some() || is_two_parts(text)
}

/// Whether `text` is hours and minutes, or minutes and seconds.
pub fn is_two_parts(text: &str) -> bool {
    let parts: Vec<&str> = text.trim().split(':').collect();
    let is_part = |part: &&str| (1..=2).contains(&part.len()) && all_digits(part);
    parts.len() == 2 && parts.iter().all(is_part)
}

/// How the fractions of seconds in a column are written.
#[derive(Clone, Debug, Default)]
pub struct Digits {
    /// Fewest and most digits.
    widths: Option<(usize, usize)>,
    /// Whether one begins with 0, and one of several digits ends with it.
    begins: bool,
    ends: bool,
    /// By how much the time of each row is another one where its digits are milliseconds, s.
    shifts_s: Vec<f64>,
}

impl Digits {
    /// Takes the cell `text`.
    pub fn take(&mut self, text: &str) {
        let behind =
            text.rsplit(':').next().and_then(|seconds| seconds.split_once(['.', ','])).map(|(_, behind)| behind);
        let behind = behind.unwrap_or_default();
        let digits = &behind[..behind.find(|c: char| !c.is_ascii_digit()).unwrap_or(behind.len())];
        let whole: f64 = digits.parse().unwrap_or(0.0);
        self.shifts_s.push(whole / 1e3 - whole / 10_f64.powi(digits.len() as i32));
        if digits.is_empty() {
            return;
        }
        let (fewest, most) = self.widths.unwrap_or((digits.len(), digits.len()));
        self.widths = Some((fewest.min(digits.len()), most.max(digits.len())));
        self.begins |= digits.len() > 1 && digits.starts_with('0');
        self.ends |= digits.len() > 1 && digits.ends_with('0');
    }

    /// Whether they are numbers of milliseconds: neither all of one width nor without the zeros at their end.
    pub fn are_milliseconds(&self) -> bool {
        self.widths.is_some_and(|(fewest, most)| fewest < most && most == 3) && self.ends && !self.begins
    }

    /// Whether they may be that as well: then the times `clock_s` increase in more even steps.
    pub fn may_be_milliseconds(&self, clock_s: &[f64]) -> bool {
        let unevenness = |times: &mut dyn Iterator<Item = f64>| {
            let mut last = times.next()?;
            let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
            for now in times {
                (least, most) = (least.min(now - last), most.max(now - last));
                last = now;
            }
            (least > 0.0).then_some(most - least)
        };
        let as_read = unevenness(&mut clock_s.iter().copied());
        let shifted = || unevenness(&mut clock_s.iter().zip(&self.shifts_s).map(|(time, shift)| time + shift));
        let are_mixed = self.widths.is_some_and(|(fewest, most)| fewest < most && most == 3) && !self.begins;
        are_mixed
            && self.shifts_s.len() == clock_s.len()
            && as_read.zip(shifted()).is_some_and(|(read, other)| other < read)
    }
}

fn of_day(text: &str) -> Option<f64> {
    let lower = text.to_lowercase().replace("a.m.", "am").replace("p.m.", "pm");
    let (clock, half) = match (lower.strip_suffix("am"), lower.strip_suffix("pm")) {
        (Some(clock), _) => (clock.trim_end(), Some(0.0)),
        (_, Some(clock)) => (clock.trim_end(), Some(12.0)),
        _ => (lower.as_str(), None),
    };
    let clock = ["z", "utc", "gmt"].iter().find_map(|zone| clock.strip_suffix(zone)).unwrap_or(clock).trim_end();
    // Where clocks are changed, the zone changes with them.
    let (clock, zone_s) = match clock.find(['+', '-']) {
        Some(at) => (clock[..at].trim_end(), zone(&clock[at..])?),
        None => (clock, 0.0),
    };
    let parts: Vec<&str> = clock.split(':').collect();
    let whole = |part: &str| part.parse::<f64>().ok().filter(|_| part.len() <= 3 && all_digits(part));
    let seconds = |part: &str| {
        let (number, broken) = part.split_once(['.', ',']).unwrap_or((part, ""));
        let is_number = (1..=2).contains(&number.len()) && all_digits(number) && all_digits(broken);
        part.replace(',', ".").parse::<f64>().ok().filter(|_| is_number)
    };
    let (hours, minutes, seconds) = match parts.as_slice() {
        [h, m, s] => (whole(h)?, whole(m)?, seconds(s)?),
        // Milliseconds behind a third colon.
        [h, m, s, ms] if ms.len() == 3 => (whole(h)?, whole(m)?, whole(s)? + whole(ms)? / 1e3),
        [m, s] if s.contains(['.', ',']) => (0.0, whole(m)?, seconds(s)?),
        _ => return None,
    };
    if seconds >= 61.0 || (parts.len() > 2 && minutes >= 60.0) {
        return None;
    }
    let hours = half.map_or(Some(hours), |half| (1.0..=12.0).contains(&hours).then_some(hours % 12.0 + half))?;
    Some(3600.0 * hours + 60.0 * minutes + seconds - zone_s)
}

/// Seconds of a zone before that of Greenwich: +01:00, -0330 or +2.
fn zone(text: &str) -> Option<f64> {
    let (sign, digits) = text.split_at_checked(1)?;
    let (hours, minutes) = digits.split_once(':').or(digits.split_at_checked(2)).unwrap_or((digits, ""));
    let number = |part: &str| (part.len() <= 2 && all_digits(part)).then(|| part.parse().unwrap_or(0.0));
    let seconds = 3600.0 * number(hours).filter(|_| !hours.is_empty())? + 60.0 * number(minutes)?;
    Some(if sign == "-" { -seconds } else { seconds })
}

fn date(text: &str) -> Option<Date> {
    let parts: Vec<&str> = text.split(['-', '/', '.']).map(str::trim).collect();
    let [a, b, c] = parts.as_slice() else { return None };
    let number = |part: &str| part.parse::<i64>().ok().filter(|n| (0..=9999).contains(n));
    let month = |part: &str| {
        const MONTHS: [&str; 12] = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"];
        number(part).or_else(|| {
            let name = part.to_lowercase();
            MONTHS.iter().position(|month| name.starts_with(month)).map(|index| index as i64 + 1)
        })
    };
    let at = |year: &str, month_of: &str, day: &str| days(number(year)?, month(month_of)?, number(day)?);
    let days = match (a.len(), c.len()) {
        (4, _) => [at(a, b, c); 3],
        // A year of two digits may be in front.
        (_, 2) => [at(c, b, a), at(c, a, b), at(a, b, c)],
        _ => [at(c, b, a), at(c, a, b), None],
    };
    days.iter().any(Option::is_some).then_some(days)
}

/// Days since 1 March of year 0 of the Gregorian calendar.
fn days(year: i64, month: i64, day: i64) -> Option<i64> {
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    Some(365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400) + (153 * month + 2) / 5 + day)
}

/// The clock of a file: seconds since midnight of its first row.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    last: Option<(Stamp, f64)>,
    /// Orders of the parts of dates that a row before excludes.
    excluded: [bool; 3],
}

impl Clock {
    /// The time of `stamp`, s. A clock without a date is a day further where it goes back by more than half a day.
    /// The date must follow that of the row before, and not be one of two.
    pub fn seconds(&mut self, stamp: Stamp) -> Result<f64, String> {
        let midnight_s = match self.last.take() {
            None => 0.0,
            Some((last, midnight_s)) => {
                let days = match (&last.date, &stamp.date) {
                    (Some(before), Some(now)) => self.days_between(before, now)?,
                    _ => i64::from(last.of_day_s - stamp.of_day_s > DAY_S / 2.0),
                };
                midnight_s + DAY_S * days as f64
            }
        };
        let now = midnight_s + stamp.of_day_s;
        self.last = Some((stamp, midnight_s));
        Ok(now)
    }

    /// Days from one row's date to the next: a day at most in one order of their parts, or the same in all of them.
    fn days_between(&mut self, before: &Date, now: &Date) -> Result<i64, String> {
        let step = |k: usize| now[k]?.checked_sub(before[k]?).filter(|step| *step >= 0 && !self.excluded[k]);
        let steps = [0, 1, 2].map(step);
        let shortest = steps.iter().flatten().min().copied().ok_or("the date goes backwards; sort the rows")?;
        if let Some(longer) = steps.iter().flatten().find(|step| **step > shortest.max(1)).filter(|_| shortest > 1) {
            return Err(format!(
                "the date is {shortest} or {longer} days after that of the row before, by the order of day, month and year; write dates as \
                 2026-11-24"
            ));
        }
        self.excluded = steps.map(|step| step != Some(shortest));
        Ok(shortest)
    }
}
