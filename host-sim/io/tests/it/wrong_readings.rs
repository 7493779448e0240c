//! Numbers that are no reading of the film: drop-outs that are written as 0 or as a code, and voltages of the mains and of controls.

use std::f64::consts::TAU;
use std::fmt::Write;

use host_io::files::import::{Blank, Edits, Fill, Quantity};
use host_io::files::recording::Recording;

use super::cut_files::Noise;
use super::lab_files::{below, has, read, refuses};

/// A drive from 0 to 1 at a time.
type Drive = fn(f64) -> f64;

/// Drives, with the rows per second of their recordings.
const DRIVES: [(&str, f64, Drive); 6] = [
    ("slow sine", 100.0, |t| 0.5 - 0.5 * (TAU * 0.2 * t).cos()),
    ("fast sine", 100.0, |t| 0.5 - 0.5 * (TAU * 2.0 * t).cos()),
    ("sine of few rows", 10.0, |t| 0.5 - 0.5 * (TAU * 0.4 * t).cos()),
    ("steps", 100.0, |t| f64::from(u8::from((0.25 * t).fract() > 0.5))),
    ("ramps", 50.0, |t| 1.0 - (2.0 * (0.1 * t).fract() - 1.0).abs()),
    ("held", 100.0, |_| 1.0),
];

/// Readings (m) of a film that creeps, late by some rows, under `drive`: of a sensor with this zero, noise and resolution.
fn recorded(
    (rate_hz, drive): (f64, Drive),
    late: usize,
    (zero, noise, resolution): (f64, f64, f64),
    random: &mut Noise,
) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let time_s: Vec<f64> = (0..(40.0 * rate_hz) as usize).map(|k| k as f64 / rate_hz).collect();
    let volts: Vec<f64> = time_s.iter().map(|t| 3e3 * drive(*t)).collect();
    let mut crept = 0.0;
    let moved = volts.iter().map(|v| {
        let load = (v / 3e3).powi(2);
        crept += (load - crept) / (5.0 * rate_hz);
        load + 0.2 * crept
    });
    let stroke: Vec<f64> = moved.collect();
    let reading = (0..stroke.len()).map(|k| {
        let value = 1e-3 * stroke[k.saturating_sub(late)] + zero + noise * random.next();
        if resolution > 0.0 { (value / resolution).round() * resolution } else { value }
    });
    let reading = reading.collect();
    (time_s, volts, reading)
}

fn recording(time_s: &[f64], volts: &[f64], reading: &[f64]) -> Recording {
    let columns = vec![(Quantity::Voltage, volts.to_vec()), (Quantity::Displacement, reading.to_vec())];
    Recording::of_values("film.csv", time_s.to_vec(), columns).expect("a recording")
}

/// Sensors: zero, noise and resolution, m.
const SENSORS: [(f64, f64, f64); 5] =
    [(0.0, 0.0, 0.0), (0.0, 1e-5, 0.0), (0.0, 0.0, 1e-5), (0.0, 2e-5, 5e-5), (-4e-4, 1e-5, 1e-5)];

/// Whatever the film does at 0, its readings are not taken for drop-outs.
#[test]
fn sound_readings_are_no_drop_outs() {
    let mut random = Noise(3);
    for (name, rate_hz, drive) in DRIVES {
        for sensor in SENSORS {
            for late in [0, 1, (0.2 * rate_hz) as usize] {
                let (time_s, volts, reading) = recorded((rate_hz, drive), late, sensor, &mut random);
                let found = recording(&time_s, &volts, &reading).drop_outs();
                assert_eq!(found, None, "{name}, {sensor:?}, {late} rows late");
            }
        }
    }
}

/// Drop-outs of 0, of the largest number of a sensor, or a code, one row or many, once or more often.
#[test]
fn drop_outs_that_are_numbers_are_found() {
    let mut random = Noise(5);
    let (mut missed, mut count) = (Vec::new(), 0);
    for (name, rate_hz, drive) in DRIVES {
        for sensor in [(2e-3, 0.0, 0.0), (2e-3, 1e-5, 0.0), (5e-4, 5e-6, 1e-5), (-3e-3, 1e-5, 0.0)] {
            for (code, times) in
                [(0.0, 1), (0.0, 4), (-1.0, 4), (9.999e-3, 4), (9.999e-3, 2), (32.767e-3, 1), (0.0, 12)]
            {
                for length in [1, 3, 20] {
                    let (time_s, volts, mut reading) = recorded((rate_hz, drive), 0, sensor, &mut random);
                    let mut rows = Vec::new();
                    for place in 0..times {
                        let from = (reading.len() as f64 * (place as f64 + 0.55) / f64::from(times)) as usize;
                        rows.extend(from..from + length);
                    }
                    // Not while the drive steps: the film may do the same there.
                    let is_step = |k: usize| (volts[k] - volts[k - 1]).abs() > 300.0;
                    let near = (0.6 * rate_hz) as usize;
                    if rows.iter().any(|&k| (k.saturating_sub(near).max(1)..=k + 1).any(is_step)) {
                        continue;
                    }
                    rows.iter().for_each(|&k| reading[k] = code);
                    count += 1;
                    let found = recording(&time_s, &volts, &reading).drop_outs();
                    if found.as_ref().is_none_or(|found| found.value_m != code || found.rows != rows) {
                        missed.push(format!("{name} {sensor:?} {code} × {times} of {length}: {found:?}"));
                    }
                }
            }
        }
    }
    assert!(count > 200, "{count}");
    assert!(missed.is_empty(), "{} of {count}: {}", missed.len(), missed[..missed.len().min(10)].join("\n"));
}

/// Codes among the voltages are found, whatever the drive, and are filled; sound drives have none, nor have pulses that the film answers.
#[test]
fn codes_among_voltages_are_found() {
    let mut random = Noise(7);
    for (name, rate_hz, drive) in DRIVES {
        let (time_s, volts, reading) = recorded((rate_hz, drive), 0, (0.0, 1e-5, 0.0), &mut random);
        let found = recording(&time_s, &volts, &reading).implausible();
        assert!(found.is_empty(), "{name}: {found:?}");
        // Not while the drive steps, which the film answers.
        for (code, times, rows) in
            [(9999.0, 4, 1), (-9999.0, 3, 2), (32_767.0, 1, 1), (65_535.0, 9, 3), (9999.0, 2, 30)]
        {
            let mut coded = volts.clone();
            let (step, rows) = (
                volts.len() as f64 / times as f64,
                rows.min(if name.contains("sine") { 3 } else { (0.4 * rate_hz) as usize }),
            );
            for place in 0..times {
                coded[(step * (place as f64 + 0.53)) as usize..][..rows].fill(code);
            }
            let found = recording(&time_s, &coded, &reading).implausible();
            assert_eq!(found.len(), 1, "{name}: {found:?}");
            println!("{name}, {code} {times} times in {rows} rows");
            has(&found[0], &["exactly", &code.to_string(), "`fill` linear"]);
            let edits = Edits { blanks: vec![Blank::Equal(Quantity::Voltage, code)], ..Edits::NONE };
            let series = recording(&time_s, &coded, &reading).into_series();
            let (series, blanked) = series.edited(&edits, Some(Fill::Linear)).expect("rows are left");
            assert_eq!(blanked, times * rows);
            let filled = Recording::from_series("film.csv".as_ref(), series).drive().expect("complete");
            // On the line between the rows around.
            let off = filled.samples().value.iter().zip(&volts).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(rows > 3 || off < 0.15 * 3e3, "{name}: {off} V");
        }
    }
    // The film moves by less than a tenth while this is there; a code within its range, which it does not answer.
    let slow = |t: f64| 0.5 - 0.5 * (TAU * 0.2 * t).cos();
    let (time_s, mut volts, reading) = recorded((100.0, slow), 0, (0.0, 1e-5, 0.0), &mut random);
    (0..6).for_each(|place| volts[600 * place + 130] = -999.0);
    has(&recording(&time_s, &volts, &reading).implausible().join("\n"), &["6 values of the drive are exactly -999"]);
    // Rows that are far apart.
    let slower = |t: f64| 0.5 - 0.5 * (TAU * 0.05 * t).cos();
    let (time_s, mut volts, reading) = recorded((2.0, slower), 0, (0.0, 1e-5, 0.0), &mut random);
    [13, 34, 57].into_iter().for_each(|row| volts[row] = 9999.0);
    has(&recording(&time_s, &volts, &reading).implausible().join("\n"), &["3 values of the drive are exactly 9999"]);
    // Pulses of different rates and lengths that the film follows at once, or within 0.1 s.
    for (rate_hz, length_s, every_s) in [(20.0, 0.05, 1.0), (100.0, 0.1, 3.0), (1000.0, 0.05, 2.0), (1000.0, 0.4, 9.0)]
    {
        for slow_s in [0.0, 0.1] {
            let (mut crept, time_s) =
                (0.0, (0..(40.0 * rate_hz) as usize).map(|k| k as f64 / rate_hz).collect::<Vec<f64>>());
            let volts: Vec<f64> =
                time_s.iter().map(|t| if (t + 0.5) % every_s < length_s - 1e-9 { 3e3 } else { 300.0 }).collect();
            let share = if slow_s > 0.0 { 1.0 - f64::exp(-1.0 / (rate_hz * slow_s)) } else { 1.0 };
            let moved = volts.iter().map(|v| {
                crept += share * ((v / 3e3).powi(2) - crept);
                1e-3 * crept + 1e-6 * random.next()
            });
            let moved: Vec<f64> = moved.collect();
            let found = recording(&time_s, &volts, &moved).implausible();
            assert!(found.is_empty(), "{rate_hz} Hz, {length_s} s every {every_s} s, {slow_s} s: {found:?}");
        }
    }
}

/// Columns of voltages that are not on the film: by their names a question, by their numbers a warning.
#[test]
fn voltages_of_mains_and_controls_are_not_the_films() {
    let rivals = include_str!("files/rivals.txt").lines();
    for name in rivals.filter_map(|line| line.strip_prefix("other voltage: ")) {
        let text = below(&format!("Time (s);{name};Laser (mm)"), |s| vec![s.time_s, 1e3 * s.voltage_kv, s.laser_mm]);
        refuses(&text, "", &["`columns` voltage="]);
    }
    // Rows at 100 Hz of numbers that are all of the mains, or of a control voltage.
    let table = |volts: &dyn Fn(f64) -> f64| {
        let time_s: Vec<f64> = (0..500).map(|k| f64::from(k) / 100.0).collect();
        let reading: Vec<f64> = time_s.iter().map(|t| 1e-3 * (1.0 - (TAU * 0.4 * t).cos())).collect();
        recording(&time_s, &time_s.iter().map(|t| volts(*t)).collect::<Vec<f64>>(), &reading).implausible().join("\n")
    };
    let mut random = std::cell::RefCell::new(Noise(9));
    for usual in [110.0, 120.0, 230.0, 240.0, 400.0] {
        let noise = |share: f64| 1.0 + share * random.borrow_mut().next();
        has(&table(&|_| usual * noise(0.01)), &["mains"]);
        has(&table(&|t| usual * 2f64.sqrt() * (TAU * 49.3 * t).sin()), &["mains"]);
        has(&table(&|t| usual * 2f64.sqrt() * (TAU * 0.6 * t).sin()), &["mains"]);
    }
    has(&table(&|t| 5.0 * (1.0 - (TAU * 0.4 * t).cos())), &["monitor's output, or kilovolts"]);
    // Voltages on films.
    random.get_mut().next();
    for peak in [300.0, 325.0, 1000.0, 3500.0] {
        let found = table(&|t| 0.5 * peak * (1.0 - (TAU * 0.4 * t).cos()));
        assert!(found.is_empty(), "{found}");
    }
    for held in [300.0, 3500.0] {
        let found = table(&|_| held);
        assert!(found.is_empty(), "{found}");
    }
}

/// Remarks on a recording of these times, in a column with this name, and voltages.
fn doubts(time: &str, rows: impl Iterator<Item = (f64, f64)>) -> String {
    let mut text = format!("{time},voltage_v,displacement_m\n");
    rows.for_each(|(t, volts)| writeln!(text, "{t},{volts},{}", 1e-10 * volts * volts).expect("written"));
    read(text, "").expect("read").implausible().join("\n")
}

/// Milliseconds in a column of seconds, at any usual rate, and seconds in one of milliseconds; slow recordings are not reported.
#[test]
fn milliseconds_in_a_column_of_seconds_are_found() {
    for (step, period, found) in [
        (0.5, 5000.0, true),
        (1.0, 5000.0, true),
        (2.0, 1e4, true),
        (10.0, 5000.0, true),
        (1.0, 60.0, false),
        (0.1, 5000.0, false),
    ] {
        let volts = |t: f64| 1500.0 * (1.0 - (TAU * t / period).cos());
        let times = (0..30_000).map(|k| step * f64::from(k));
        let text = doubts("time_s", times.map(|t| (t, volts(t))));
        assert_eq!(text.contains("ms in a column of s?"), found, "{step} {period}: {text}");
    }
    // 150 and 600 s at 20 and 10 Hz.
    for (seconds, rate_hz, unit_s) in [(150, 20, 1.0), (600, 10, 1.0), (150, 20, 1e3), (3, 1000, 1e3)] {
        let times = (0..seconds * rate_hz).map(|k| f64::from(k) / f64::from(rate_hz));
        let rows = times.map(|t| (t * unit_s, 1500.0 * (1.0 - (TAU * t / 2.0).cos())));
        let text = doubts("time_ms", rows);
        assert_eq!(text.contains("seconds in a column of ms?"), unit_s == 1.0, "{seconds} {rate_hz}: {text}");
    }
}

/// Minutes and hours in a column of seconds, of random recordings; none in seconds is doubted.
#[test]
fn minutes_and_hours_in_a_column_of_seconds_are_found() {
    let mut noise = Noise(29);
    let mut range = |low: f64, high: f64| low + 0.5 * (noise.next() + 1.0) * (high - low);
    let mut judged = 0;
    for case in 0..60 {
        let rate_hz = [10.0, 20.0, 50.0, 100.0, 200.0, 250.0, 500.0][range(0.0, 7.0) as usize];
        let (unit_s, unit) = [(60.0, "min"), (3600.0, "h"), (1.0, "")][case % 3];
        let period_s = range(2.0, 18.0);
        let decimals = range(6.0, 12.0) as usize;
        let noise_v = range(0.0, 5.0);
        let mut text = String::from("time_s,voltage_v,displacement_m\n");
        for t in (0..(40.0 * rate_hz) as u32).map(|k| f64::from(k) / rate_hz) {
            let volts = 1500.0 * (1.0 - (TAU * t / period_s).cos()) + noise_v * range(-1.0, 1.0);
            let decimals = if unit_s > 1.0 { decimals } else { 3 };
            writeln!(text, "{:.decimals$},{volts:.1},{}", t / unit_s, 1e-10 * volts * volts).expect("written");
        }
        // Rows of one time, where the decimals are too few, are another question.
        let Ok(recording) = read(text, "") else { continue };
        judged += 1;
        let text = recording.implausible().join("\n");
        let wanted = format!("{unit} in a column of s? State the unit, as in `columns` time=1:{unit}");
        assert!(
            if unit.is_empty() { text.is_empty() } else { text.contains(&wanted) },
            "{rate_hz} {period_s} {unit}: {text}"
        );
    }
    assert!(judged > 45, "{judged}");
    // A camera's rate is round in minutes as well; a step has no cycles.
    for (rate_hz, hold, found) in
        [(60.0, false, false), (120.0, false, false), (100.0, true, false), (6000.0, true, true)]
    {
        let step = |t: f64| 2000.0 * f64::from(u8::from(t > 0.12));
        let volts = |t: f64| if hold { step(t) } else { 1500.0 * (1.0 - (TAU * t).cos()) };
        let times = (0..(1800.0_f64).min(20.0 * rate_hz) as u32).map(|k| f64::from(k) / rate_hz);
        let text = doubts("time_s", times.map(|t| (t, volts(t))));
        assert_eq!(text.contains("min in a column of s?"), found, "{rate_hz} {hold}: {text}");
    }
}

/// Numbers of rows in a column of seconds, of cycles at usual rates; not times that no row number is, a slow log, and a unit that is given.
#[test]
fn numbers_of_rows_in_a_column_of_seconds_are_found() {
    let text = |interval_s: f64, rows_per_cycle: f64, title: &str| {
        let mut text = format!("{title},voltage_v,displacement_m\n");
        for k in (1..=600).map(f64::from) {
            let volts = 1500.0 * (1.0 - (TAU * k / rows_per_cycle).cos());
            writeln!(text, "{},{volts:.1},{}", interval_s * k, 1e-10 * volts * volts).expect("written");
        }
        text
    };
    let noted = |text: &str, answer: &str| read(text, answer).expect("read").remarks().join("\n");
    has(&noted("time_s,voltage_kv\n0,0\n5,6000\n", ""), &["the largest voltage is 6000000 V", "voltage=2:V"]);
    for (interval_s, rows_per_cycle, title) in [(1.0, 50.0, "time_s"), (1.0, 100.0, "Time (s)"), (2.0, 80.0, "t/s")] {
        let text = text(interval_s, rows_per_cycle, title);
        has(&noted(&text, ""), &["numbers of the rows", "`rate_hz`", "time=1:s"]);
        assert_eq!(noted(&text, "time=1:s"), "");
    }
    for (interval_s, rows_per_cycle, title) in [(1.0, 20.0, "time_s"), (0.5, 100.0, "time_s"), (20.0, 50.0, "time_ms")]
    {
        assert_eq!(noted(&text(interval_s, rows_per_cycle, title), ""), "", "{interval_s} {rows_per_cycle}");
    }
}

/// Millimetres in a column of micrometres.
#[test]
fn millimetres_in_a_column_of_micrometres_are_found() {
    for (peak, found) in [(0.4, true), (2.6, true), (5.0, true), (45.0, false), (2600.0, false)] {
        let table = |header: &str| {
            let mut text = format!("{header}\n");
            for t in (0..600).map(|k| 0.05 * f64::from(k)) {
                let share = 0.5 * (1.0 - (TAU * t / 8.0).cos());
                writeln!(text, "{t:.2},{:.1},{:.5}", 3000.0 * share.sqrt(), peak * share).expect("written");
            }
            text
        };
        for (header, hints) in [("time_s,voltage_v,displacement_um", ""), ("Time (s),HV (V),Laser (µm)", "")] {
            let text = read(table(header), hints).expect("read").implausible().join("\n");
            assert_eq!(text.contains("mm in a column of µm? State the unit"), found, "{header} {peak}: {text}");
        }
        // A person's word.
        let text = read(table("Time (s),HV (V),Laser"), "displacement=3:um").expect("read").implausible();
        assert!(peak < 3.0 || text.is_empty(), "{peak}: {text:?}");
    }
}

/// One reading of the voltage that was lost, in random recordings, is named with its time, and what is advised empties it alone.
#[test]
fn lone_readings_of_the_drive_are_named() {
    let mut noise = Noise(31);
    let mut range = |low: f64, high: f64| low + 0.5 * (noise.next() + 1.0) * (high - low);
    for case in 0..60 {
        let (rate_hz, period_s) = (range(20.0, 200.0).round(), range(3.0, 15.0));
        let rests = case % 2 == 0;
        let count = 1 + (case % 3);
        let samples = (60.0 * rate_hz) as usize;
        let lost: Vec<usize> = (0..count).map(|_| range(0.2, 0.9) * samples as f64).map(|row| row as usize).collect();
        let mut rows = Vec::new();
        let mut film = 0.0;
        for k in 0..samples {
            let t = k as f64 / rate_hz;
            let is_at_rest = rests && t < 5.0;
            let share = if is_at_rest { 0.0 } else { 0.5 - 0.5 * (TAU * (t - 5.0) / period_s).cos() };
            let volts = 4000.0 * share.sqrt();
            film += (1e-3 * share - film) * (1.0 - (-1.0 / (0.4 * rate_hz)).exp());
            rows.push([t, volts, film + range(-4e-6, 4e-6)]);
        }
        // One that is far from those around it: others are no matter.
        let lost: Vec<usize> = lost.into_iter().filter(|row| rows[*row][1] > 1000.0).collect();
        let value = if case % 4 == 3 { 4800.0 } else { 0.0 };
        let mut text = String::from("time_s,voltage_v,displacement_m\n");
        for (k, [t, volts, film]) in rows.iter().enumerate() {
            let volts = if lost.contains(&k) { value } else { *volts };
            writeln!(text, "{t:.5},{volts:.1},{film:.7}").expect("written");
        }
        let recording = read(&text, "").expect("read");
        let found = recording.implausible().join("\n");
        if lost.is_empty() {
            assert!(found.is_empty(), "{case}: {found}");
            continue;
        }
        let Some((_, advice)) = found.split_once("import ") else {
            panic!("{case} {rate_hz} {period_s} {lost:?}: {found}")
        };
        let blanks = advice.split("`blank` ").skip(1).map(|blank| blank.split([' ', '`']).next().expect("a word"));
        let blanks: Vec<Blank> = blanks.map(|blank| blank.parse().expect(blank)).collect();
        let edits = Edits { blanks, ..Edits::NONE };
        let (series, emptied) = recording.into_series().edited(&edits, Some(Fill::Linear)).expect("rows");
        let fixed = Recording::from_series(std::path::Path::new("film.csv"), series);
        assert!(emptied >= 1 && emptied <= lost.len(), "{case}: {emptied} of {lost:?}");
        assert_eq!(fixed.columns()[0].1.len(), samples);
        for &row in &lost {
            let off = fixed.columns()[0].1[row] - rows[row][1];
            assert!(off.abs() < 0.05 * 4000.0, "{case}: {off} V in row {row}, {found}");
        }
    }
}
