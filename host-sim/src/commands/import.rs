//! `import`: files of other programs as recordings.

use super::prelude::*;
use super::recordings::RawOptions;
use crate::choice::Choice;
use crate::files::import::{Blank, By, Edits, Hints, Quantity, Series, Understood, UnderstoodColumn};
use crate::files::recording::Recording;
use crate::grid::{peak, range};
use crate::statistics::median;
use crate::terminal::rounded;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    options: RawOptions,
    /// Keep rows from here on, s from the first. What the film remembers of the rows before is lost: begin at rest.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 0.0)]
    from: f64,
    /// Keep rows up to here, s from the first. The default is the end.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    to: Option<f64>,
    /// Average every N rows into one.
    #[arg(long, value_name = "N", default_value_t = 1)]
    decimate: usize,
    /// Discard drop-outs: displacement=-9999, "displacement>12" (numbers of the file), 12.5..13 (s), or a word
    /// for a missing reading. May be repeated.
    #[arg(long, value_name = "WHAT")]
    blank: Vec<Blank>,
    /// Folder for the recordings, one CSV per file.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Text with any separator and decimal sign, .xlsx or .mat.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    files: Vec<Imported>,
}

/// A file and what became of it.
#[derive(Serialize)]
struct Imported {
    #[serde(flatten)]
    understood: Understood,
    out: String,
    rows: usize,
    /// Rate of the median interval.
    rate_hz: f64,
    duration_s: f64,
    /// Readings that `--blank` emptied.
    blanked: usize,
    ranges: Vec<Range>,
    /// Intervals of more than five medians, and the longest.
    gaps: usize,
    longest_gap_s: f64,
    warnings: Vec<String>,
}

/// Values of a column, SI.
#[derive(Serialize)]
struct Range {
    quantity: Quantity,
    low: f64,
    high: f64,
    empty: usize,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let edits = Edits::new(arguments.blank.clone(), arguments.from, arguments.to, arguments.decimate)?;
    let outputs = arguments.outputs()?;
    let hints = Hints { words: Blank::words(&arguments.blank), ..arguments.options.hints()? };
    let omits_displacement = hints.choices.get(Quantity::Displacement).is_some_and(|choice| choice.column.is_none());
    let mut imported = Vec::new();
    for (path, out) in arguments.files.iter().zip(&outputs) {
        let series = Recording::read_with(path, &hints)?.into_series();
        let starts_at_rest = edits.from_s == 0.0 || at_rest(&series, edits.from_s);
        let (series, blanked) = series.edited(&edits, hints.fill).map_err(|cause| Error::file(path, cause))?;
        let understood = series.understood.clone();
        let recording = Recording::from_series(path, series);
        // A drive with gaps is an error now, not only when it is fitted.
        recording.drive()?;
        let response = recording.doubtful_response().filter(|_| !omits_displacement);
        let mut report = Imported::new(&recording, understood, out, blanked, starts_at_rest);
        report.warnings.extend(response.map(|text| with_flags(&text)));
        imported.push((report, recording));
    }
    // Removed again if it stays empty.
    let _folder = Folder::at(&arguments.out)?;
    let mut staged = Vec::new();
    for ((_, recording), out) in imported.iter().zip(&outputs) {
        staged.push(stage(out, recording)?);
    }
    staged.into_iter().try_for_each(Staged::commit)?;
    let report = Report { files: imported.into_iter().map(|(report, _)| report).collect() };
    terminal::report(json, &report, || {
        terminal::shortened(&report.files.iter().map(text).collect::<Vec<_>>().join("\n\n"))
    })
}

impl Arguments {
    /// Folder for the recordings. Two of one name, and a file that is read, are refused.
    fn outputs(&self) -> Result<Vec<PathBuf>> {
        let inputs: Vec<&Path> = self.files.iter().map(PathBuf::as_path).collect();
        let mut outputs: Vec<PathBuf> = Vec::new();
        for file in &self.files {
            let name = file.file_stem().ok_or_else(|| Error::file(file, "is not a file; name files to import"))?;
            let mut out = self.out.join(name);
            out.as_mut_os_string().push(".csv");
            if outputs.contains(&out) {
                let cause =
                    format!("two files would be written to {}; import them into different folders", shown(&out));
                return Err(Error::field("out", cause));
            }
            output::check(&out, &inputs, Folders::AreMade)?;
            if Recording::is_foreign(&out) {
                let cause = format!(
                    "{} is there, with other names than a recording of this tool: name another folder",
                    shown(&out)
                );
                return Err(Error::field("out", cause));
            }
            outputs.push(out);
        }
        Ok(outputs)
    }
}

/// Whether nothing drives the film at `from_s`.
fn at_rest(series: &Series, from_s: f64) -> bool {
    let start = series.clock_s[0];
    let recording = Recording::from_series(Path::new(""), series.clone());
    let Ok(drive) = recording.drive() else { return true };
    let drive = drive.samples();
    let largest = peak(&drive.value);
    let first = series.clock_s.iter().position(|t| t - start >= from_s).unwrap_or(0);
    drive.value.get(first).is_none_or(|value| value.abs() <= 0.01 * largest)
}

impl Imported {
    fn new(recording: &Recording, understood: Understood, out: &Path, blanked: usize, starts_at_rest: bool) -> Self {
        let steps: Vec<f64> = recording.time_s().windows(2).map(|pair| pair[1] - pair[0]).collect();
        let step = median(&steps);
        let gaps = || steps.iter().copied().filter(|length| *length > 5.0 * step);
        let ranges: Vec<Range> =
            recording.columns().iter().filter_map(|(name, values)| Range::from_values(name, values)).collect();
        let mut warnings = Vec::new();
        if !starts_at_rest {
            warnings
                .push("the drive is not 0 at --from: what the film remembers of the rows before is lost".to_owned());
        }
        let doubts = recording.implausible().into_iter().chain(recording.doubts());
        warnings.extend(doubts.map(|text| with_flags(&text)));
        Self {
            out: shown(out),
            rows: recording.time_s().len(),
            rate_hz: 1.0 / step,
            duration_s: recording.duration_s(),
            blanked,
            ranges,
            gaps: gaps().count(),
            longest_gap_s: gaps().fold(0.0, f64::max),
            warnings,
            understood: Understood {
                notes: understood.notes.iter().map(|note| with_flags(note)).collect(),
                ..understood
            },
        }
    }

    fn range(&self, quantity: Quantity) -> Option<&Range> {
        self.ranges.iter().find(|range| range.quantity == quantity)
    }
}

impl Range {
    fn from_values(name: &str, values: &[f64]) -> Option<Self> {
        let quantity = Quantity::CHOICES.iter().find(|(_, known, _)| name.starts_with(known))?.0;
        let (low, high) = range(values);
        let empty = values.iter().filter(|value| value.is_nan()).count();
        (low <= high).then_some(Self { quantity, low, high, empty })
    }

    fn text(&self) -> String {
        let empty = if self.empty > 0 { format!(", {} empty", self.empty) } else { String::new() };
        format!("{} to {} {}{empty}", rounded(self.low), rounded(self.high), self.quantity.si_unit())
    }
}

fn stage(out: &Path, recording: &Recording) -> Result<Staged> {
    let time = recording.time_s();
    let columns = recording.columns();
    let mut named: Vec<(&str, Option<&[f64]>)> = vec![("time_s", Some(time))];
    named.extend(columns.iter().map(|(name, values)| (*name, Some(values.as_slice()))));
    output::stage_columns(out, &named)
}

/// Where a column comes from: `column 2 "U [kV]", × 1000`.
fn origin(column: &UnderstoodColumn) -> String {
    let unit = if column.unit.is_empty() { String::new() } else { format!(" in {}", column.unit) };
    let by = match column.by {
        By::Unit => ", by its unit alone",
        By::Preamble => ", by the interval in the preamble",
        By::Choice => ", as chosen",
        By::OwnName | By::Name => "",
    };
    format!("column {} {:?}{unit}, × {}{by}", column.column, column.name, column.factor)
}

fn text(file: &Imported) -> String {
    let Imported { understood, rows, .. } = file;
    let lines_above = match understood.preamble_lines {
        0 => String::new(),
        1 => ", 1 line above the header".into(),
        lines => format!(", {lines} lines above the header"),
    };
    let mut lines = vec![format!("{}: {}{lines_above}", understood.file, understood.format)];
    let line = |name: &str, what: &str| format!("{name:12} {what}");
    let (times, others): (Vec<_>, Vec<_>) =
        understood.columns.iter().partition(|column| column.quantity == Quantity::Time);
    let time = times.first().map_or_else(|| "from the rate of the rows".into(), |column| origin(column));
    let (rate_hz, duration_s) = (rounded(file.rate_hz), rounded(file.duration_s));
    lines.push(line("time", &format!("{time}: {rows} rows at {rate_hz} Hz, {duration_s} s")));
    for column in others {
        let values = file.range(column.quantity).map_or_else(|| "empty".into(), Range::text);
        lines.push(line(column.quantity.name(), &format!("{}: {values}", origin(column))));
    }
    if !understood.ignored.is_empty() {
        lines.push(line("ignored", &understood.ignored.join(", ")));
    }
    if file.gaps > 0 {
        let longest_s = rounded(file.longest_gap_s);
        lines.push(line("gaps", &format!("{} in the rows, the longest of {longest_s} s", file.gaps)));
    }
    if file.blanked > 0 {
        lines.push(line("blanked", &format!("{} readings", file.blanked)));
    }
    lines.extend(understood.notes.iter().map(|note| line("note", note)));
    lines.extend(file.warnings.iter().map(|warning| format!("warning: {warning}")));
    lines.push(line("written", &file.out));
    lines.join("\n  ")
}
