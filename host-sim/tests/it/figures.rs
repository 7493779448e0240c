//! Contents of figures: thinned lines, spectra, and the course of a recording.

use std::f64::consts::TAU;

use documents::Documents;
use host_sim::cost::Cost;
use host_sim::grid::Samples;
use host_sim::report::course::Course;
use host_sim::report::drawing;
use host_sim::report::figure::{Figure, Line, MAX_POINTS, Panel};
use host_sim::spectrum::{self, Spectrum};

fn series(count: usize, step_s: f64, value: impl Fn(f64) -> f64) -> Samples {
    let time_s: Vec<f64> = (0..count).map(|k| step_s * k as f64).collect();
    Samples { value: time_s.iter().map(|t| value(*t)).collect(), time_s }
}

/// Thinning 100 000 points keeps those that a screen shows: both ends, and each peak of a single sample.
#[test]
fn thinned_lines_keep_ends_and_peaks() {
    let mut all = series(100_000, 1e-3, |t| (TAU * 0.2 * t).sin());
    for (row, peak) in [(12_345, 7.0), (54_321, -9.0), (99_998, 8.0)] {
        all.value[row] = peak;
    }
    let line = Line::new("line", &all.time_s, &all.value);
    assert!(line.points.len() <= MAX_POINTS && line.points.len() > MAX_POINTS / 2, "{}", line.points.len());
    assert_eq!(line.all, 100_000);
    for row in [0, 12_345, 54_321, 99_998, 99_999] {
        assert!(line.points.contains(&(all.time_s[row], all.value[row])), "{row}");
    }
    assert!(line.points.windows(2).all(|pair| pair[0].0 < pair[1].0), "in order");
    let few = Line::new("few", &all.time_s[..900], &all.value[..900]);
    assert_eq!(few.points.len(), 900);
    let missing = Line::new("missing", &[0.0, 1.0, 2.0], &[1.0, f64::NAN, 3.0]);
    assert_eq!(missing.points, [(0.0, 1.0), (2.0, 3.0)]);
}

/// Parseval: the density's square over all frequencies is the mean square, of a sine A²/2.
#[test]
fn a_spectrum_holds_the_power_where_it_is() {
    let sine = series(20_000, 0.01, |t| 5.0 + 3.0 * (TAU * 2.0 * t).sin() + 0.05 * (TAU * 11.0 * t).cos());
    let Spectrum { frequency_hz, density } = Spectrum::new(&sine).expect("enough samples");
    let power: f64 = (1..frequency_hz.len())
        .map(|k| {
            let width = frequency_hz[k] - frequency_hz[k - 1];
            0.5 * width * (density[k].powi(2) + density[k - 1].powi(2))
        })
        .sum();
    println!("mean square {power}");
    // Lines are grouped in bands, which the trapezoids cross: within a fifth.
    assert!((power - 4.5).abs() < 0.9, "{power}");
    let largest = (0..density.len()).max_by(|&a, &b| density[a].total_cmp(&density[b])).expect("lines");
    assert!((frequency_hz[largest] - 2.0).abs() < 0.1);
    // 0.05 of 3 is more than 1 % and less than 2 %.
    let highest = |share| spectrum::highest_hz(&sine, share).expect("a drive");
    assert!((highest(0.01) - 11.0).abs() < 0.05 && (highest(0.02) - 2.0).abs() < 0.05);
    assert!(Spectrum::new(&series(5, 0.1, |t| t)).is_none());
}

/// White noise of 1 at 100 Hz has a density of √(2 / 100 Hz), however many samples of it there are.
#[test]
fn noise_of_long_recordings_does_not_fold_into_the_band() {
    for count in [10_000, 600_000] {
        // SplitMix64.
        let noise = |k: u64| {
            let z = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            if (z ^ (z >> 31)) >> 63 == 0 { 1.0 } else { -1.0 }
        };
        let samples = series(count, 0.01, |t| noise((100.0 * t).round() as u64 + 1));
        let Spectrum { frequency_hz, density } = Spectrum::new(&samples).expect("enough samples");
        // Far below the rate, where the mean of a few samples takes nothing away.
        let band = frequency_hz.iter().zip(&density).filter(|(hz, _)| (0.5..5.0).contains(*hz)).map(|(_, d)| d * d);
        let (sum, lines) = band.fold((0.0, 0), |(sum, lines), power| (sum + power, lines + 1));
        let found = (sum / f64::from(lines)).sqrt();
        assert!((found / 0.02_f64.sqrt() - 1.0).abs() < 0.15, "{count} samples: {found}");
    }
}

/// A step that is held, cycles, and what is neither.
#[test]
fn the_course_of_a_drive_is_recognised() {
    let held = series(1000, 0.1, |t| if t < 2.0 { 3000.0 * t } else { 6000.0 });
    let Course::Held(since_s) = Course::from_drive(&held) else { panic!("held") };
    assert!((1.9..=2.0).contains(&since_s), "{since_s}");
    assert_eq!(Course::from_drive(&series(100, 1.0, |_| 1e-3)), Course::Held(0.0));

    let sine = series(15_500, 0.01, |t| 3000.0 * (1.0 - (TAU * t / 7.0).cos()));
    let Course::Cycles(cycles) = Course::from_drive(&sine) else { panic!("cycles") };
    // 155 s hold 22 periods; a cycle is from one rise to the next.
    assert_eq!(cycles.len(), 21);
    assert!(cycles.iter().all(|cycle| (cycle.end - cycle.start - 7.0).abs() < 0.02));

    assert_eq!(Course::from_drive(&series(1000, 0.1, |t| t)), Course::Other);
    // A chirp: its cycles are not alike.
    assert_eq!(Course::from_drive(&series(10_000, 0.01, |t| (TAU * (0.05 + 0.02 * t) * t).sin())), Course::Other);
}

/// Names in a legend of an SVG are beside or below one another, not over one another.
#[test]
fn names_in_a_legend_do_not_overlap() {
    for count in 2..=6 {
        let names: Vec<String> = (0..count).map(|k| format!("line {k}, with a name of some length")).collect();
        let panel = names
            .iter()
            .fold(Panel::new("title", "x", "y"), |panel, name| panel.with(Line::new(name, &[0.0, 1.0], &[0.0, 1.0])));
        let svg = drawing::svg(&Figure::new("figure", vec![panel]));
        let place = |name: &String| -> (f64, f64) {
            let (before, _) = svg.split_once(&format!(">{name}<")).expect("in the legend");
            let element = &before[before.rfind("<text").expect("a text")..];
            let number = |key: &str| {
                let (_, rest) = element.split_once(&format!(" {key}=\"")).expect("a place");
                rest.split('"').next().and_then(|number| number.parse().ok()).expect("a number")
            };
            (number("x"), number("y"))
        };
        let places: Vec<(f64, f64)> = names.iter().map(place).collect();
        for (k, a) in places.iter().enumerate() {
            for b in &places[..k] {
                // Six pixels a letter is what the narrowest fonts take.
                let apart = (a.0 - b.0).abs() > 6.0 * names[0].len() as f64 || (a.1 - b.1).abs() > 8.0;
                assert!(apart, "{count} names: {places:?}");
            }
        }
    }
}

/// A page states the controller's cost of docs/results.md, which is counted in QEMU.
#[test]
fn stated_costs_are_those_of_the_results() {
    let documents = Documents::read().expect("readable");
    let stated = |row: &str, column: &str| documents.number(&[row], column).expect("in the table");
    let costs =
        [(Cost::LINEAR, ""), (Cost::CURVED, "+curve"), (Cost::TWO_CURVES, "+curves"), (Cost::SERIES, "+series")];
    for (cost, curve) in costs {
        let tick = format!("tick/12+36{curve}");
        assert_eq!(f64::from(cost.instructions_per_step), stated(&format!("creep/12+36{curve}"), "Cortex-M4F"));
        assert_eq!(f64::from(cost.instructions_per_tick), stated(&tick, "Cortex-M4F"));
        assert_eq!(f64::from(cost.cycles_per_tick), stated(&tick, "cycles of the M4F"));
    }
    let of = |value: fn(&Cost) -> f64| [Cost::LINEAR, Cost::CURVED].map(|cost| format!("{:.1}", value(&cost)));
    let [us, us_curved] = of(|cost| f64::from(cost.cycles_per_tick) / 168.0);
    let [pct, pct_curved] = of(|cost| cost.core_pct);
    let text = format!("takes {us} µs, behind a curve {us_curved} µs: {pct} and {pct_curved} % of a core at 1 kHz");
    let results = std::fs::read_to_string(documents::root().join("docs/results.md")).expect("readable");
    assert!(results.contains(&text), "{text}");
}
