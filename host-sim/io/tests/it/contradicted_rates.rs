//! Preambles with a rate and another line that contradicts it, and channels that begin at different times.

use super::lab_files::{Sample, below, gives_the_samples, has, refused, refuses, rows, usual};

/// The rows of the samples, at 8 Hz for 3 s, below a `preamble` and names.
fn file(preamble: &str) -> String {
    below(&format!("{preamble}\nHV (kV);Laser (mm)"), |s| vec![s.voltage_kv, s.laser_mm])
}

#[test]
fn a_rate_that_another_line_contradicts_is_a_question() {
    // The lines below a rate of 80 Hz.
    let lines = "Thinning: 10|Thinning: 1/10|Skip: 9|Omit 9 of 10 rows|Data reduction: 10|Resampled to: 8 Hz|Resample rate: 8 Hz|Subsampling: 10|Sub-sampling: 10|\
                 Save mode: every 10th sample|Speicherung: jeder 10. Wert|Binning: 10|Boxcar: 10 points, non-overlapping|Samples per point: 10|\
                 Readings per row: 10|Verdichtung: 10:1|Messwertverdichtung;10|Stride: 10|Keep: 1 of 10|Step: 10 samples|Effective rate: 8 Hz|\
                 ODR: 8 Hz|Rows per second: 8|Logged with 8 Hz|# logged with 8 Hz|[Log at 8 Hz]|Data interval: 125 ms|Save: every 125 ms|\
                 Record frequency (Hz): 8|Frequency: 8 Hz|Duration: 3 s|Duration (s);3|Recording time: 00:00:03|\
                 Start time: 10:00:00\nEnd time: 10:00:03|Start: 0 s\nEnd: 3 s|Points: 240|Record length: 240 points";
    for line in lines.split('|') {
        let text = file(&format!("Sample rate: 80 Hz\n{line}"));
        let error = refused(&text, "");
        has(&error, &["film.txt:1:", "not certain from"]);
        assert!(error.ends_with("`rate_hz` 80 or `rate_hz` 8"), "{error}");
        gives_the_samples(text, "rate=8");
    }
    // What the rate itself is of, and a number that is not stated.
    for (preamble, rates) in [
        ("Sample rate (total): 16 Hz\nChannels: 2", "`rate_hz` 16 or `rate_hz` 8"),
        ("Sample rate [all channels]: 16 Hz\nChannels: 2", "`rate_hz` 16 or `rate_hz` 8"),
        ("Sample rate (max): 80 Hz\nLog at 8 Hz", "`rate_hz` 80 or `rate_hz` 8"),
        ("[Generator]\nSample rate: 80 Hz\n[Sensor]\nModel: LK-G", "`rate_hz` 80"),
        ("# Sensor\n# Sample rate: 80 Hz", "`rate_hz` 80"),
        ("dt = 12.5 ms\nSample rate: 80 Hz\nSampling interval: 12.5 ms\nStride: 10", "\"Stride: 10\""),
        ("Sample rate: 16 Hz\nSkip samples: 1", "`rate_hz` 16 or `rate_hz` 8"),
        ("Sample rate: 80 Hz\nAveraging: on", "`rate_hz` 80"),
        ("Sample rate: 80 Hz\nSave every second sample", "`rate_hz` 80"),
    ] {
        refuses(file(preamble), "", &["the rate of the rows is not certain", rates]);
    }
}

#[test]
fn lines_that_do_not_contradict_a_rate_are_no_question() {
    let lines = "Thinning: 1|Thinning: none|Skip: 0|Logged with 8 Hz|Duration: 3 s|Duration: 2.875 s|Duration;3|Duration: 50 ms pulses, 1 Hz, 5 kV|\
                 Points: 24|Record length: 24 points|Start time: 10:00:00\nEnd time: 10:00:03|Start time: 23:59:59\nEnd time: 00:00:02|\
                 Low-pass filter: 2 Hz|Filter: moving average, 16 samples|Cut-off frequency: 1 Hz|Waveform: sine, 0.5 Hz|Drive frequency: 1 Hz|\
                 Frequency: 0.05 Hz|[Generator]\nFrequency: 1 Hz\n[Recorder]|Mains: 50 Hz|Laser: LK-G5000, 50 kHz|Clock: 84 MHz|\
                 Comment: film 3, 5 kV, 1 Hz|Film: thin, 3 layers|Film 1 of 10|Sample: 3|Channels: 2|Date: 2026/11/24|Time: 10:00:01.5|\
                 Ramp rate: 100 V/s|Strain rate: 0.01 1/s|Baud rate: 9600|Speed: 5 mm/s|Resolution: 16 bits per sample|Pre-trigger: 10 samples|\
                 File: ramp_1Hz.csv|Range: 10 V|Probe: 1:1000|Voltage divider: 1000|Noise reduction: off|Compression: none|Number of films: 3|\
                 Keep at 25 °C|Header lines: 5|Step: 0.5 kV";
    for preamble in lines.split('|').map(|line| format!("{line}\nSample rate: 8 Hz")).chain([
        "Sample rate (per channel): 8 Hz\nChannels: 2".into(),
        "Sample rate [Hz]: 8\nX0;0;0".into(),
        "Start time;10:00:00.5;10:00:00.5\nSample rate: 8 Hz".into(),
    ]) {
        gives_the_samples(file(&preamble), "");
    }
    // A column of times leaves no question.
    gives_the_samples(below("Sample rate: 80 Hz\nThinning: 10\nTime (s);HV (kV);Laser (mm)", usual), "");
}

#[test]
fn channels_that_begin_at_different_times_are_refused() {
    let numbers = |time: bool, columns: &dyn Fn(&Sample) -> Vec<f64>| {
        rows(";", '.', columns).lines().map(|row| if time { format!("{row}\n") } else { format!(";{row}\n") }).collect()
    };
    let both: [String; 2] = [numbers(true, &usual), numbers(false, &|s| vec![s.voltage_kv, s.laser_mm])];
    for (head, names) in [
        ("X_Dimension;Time;Time\nX0;0.0E+0;{}\nDelta_X;0.125;0.125", "X_Value;HV (kV);Laser (mm)"),
        ("HResolution;0.125;0.125\nHOffset;0.0;{}\nHUnit;s;s", "TraceName;HV (kV);Laser (mm)"),
        ("Time;10:00:00.000;10:00:0{}\nDelta_X;0.125;0.125\nX_Dimension;Time;Time", "X_Value;HV (kV);Laser (mm)"),
    ] {
        for (rows, _) in both.iter().zip([true, false]).filter(|(_, timed)| !timed || names.starts_with('X')) {
            let text = |offset: &str| format!("{}\n{names}\n{rows}", head.replace("{}", offset));
            let words = ["film.txt:", "for one channel and", ".5 s for another", "one time base", "by 0.5 s"];
            refuses(text("0.5"), "", &words);
            gives_the_samples(text("0.0"), "");
            // Channels that are sampled in turn.
            gives_the_samples(text("0.001"), "");
        }
    }
}
