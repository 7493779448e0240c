//! Faults of recordings, each with the words that name its cause.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_pcg::Pcg64;

use super::film::{Film, PEAK_V, Run, STEP_S, sine};

/// A fault: its name, the words of which one names it, when it acts, and what it does with a random strength.
pub(super) struct Fault {
    pub(super) name: &'static str,
    pub(super) causes: &'static [&'static str],
    pub(super) stage: Stage,
    pub(super) change: Change,
    /// Whether it is as strong in all recordings: a property of an instrument.
    pub(super) is_of_instrument: bool,
}

impl Fault {
    const fn of_instrument(self) -> Self {
        Self { is_of_instrument: true, ..self }
    }
}

type Change = fn(&mut Run, &mut Pcg64);

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Stage {
    /// Before the film moves.
    Voltage,
    /// Before the rows are taken.
    Reading,
    /// After it.
    Rows,
}

const fn voltage(name: &'static str, causes: &'static [&'static str], change: Change) -> Fault {
    Fault { name, causes, stage: Stage::Voltage, change, is_of_instrument: false }
}

const fn reading(name: &'static str, causes: &'static [&'static str], change: Change) -> Fault {
    Fault { name, causes, stage: Stage::Reading, change, is_of_instrument: false }
}

const fn rows(name: &'static str, causes: &'static [&'static str], change: Change) -> Fault {
    Fault { name, causes, stage: Stage::Rows, change, is_of_instrument: false }
}

/// Rows that are not even, at the times at which they were taken: no faults.
pub(super) const UNEVEN: [Fault; 2] = [
    rows("every second row, by chance", &[], |run, random| run.rows.retain(|_| random.random_bool(0.5))),
    rows("rows that become sparser", &[], |run, _| {
        let mut next = 0.0_f64;
        run.rows = std::iter::from_fn(|| {
            let row = run.rows.get(next as usize).copied();
            next = (1.02 * next).max(next + 1.0);
            row
        })
        .collect();
    }),
];

fn sign(random: &mut Pcg64) -> f64 {
    if random.random_bool(0.5) { 1.0 } else { -1.0 }
}

/// A time within the middle of a recording, as a step.
fn middle(run: &Run, random: &mut Pcg64) -> usize {
    (random.random_range(0.3..0.7) * run.volts.len() as f64) as usize
}

fn first_order(values: &mut [f64], rise_s: f64, fall_s: f64) {
    let mut state = values[0];
    for value in values {
        let lag_s = if *value > state { rise_s } else { fall_s };
        state += (*value - state) * (1.0 - (-STEP_S / lag_s).exp());
        *value = state;
    }
}

fn delayed(values: &mut Vec<f64>, steps: usize) {
    let mut late = vec![values[0]; steps];
    late.extend(&values[..values.len() - steps]);
    *values = late;
}

/// A late sensor and an amplifier behind its command look alike.
const LATE: &[&str] = &["late sensor"];
const ELSEWHERE: &[&str] = &["not of the film", "the reading jumps", "response to the drive changes", "drop-outs"];

pub(super) const FAULTS: &[Fault] = &[
    reading("wrong sign", &["falls where"], |run, _| run.reading.iter_mut().for_each(|x| *x = -*x)),
    rows("clipped", &["values are at the largest", "bends at one level"], |run, random| {
        let (low, top) = run.range();
        let level = low + random.random_range(0.6..0.95) * (top - low);
        run.rows.iter_mut().for_each(|row| row[2] = row[2].min(level));
    }),
    reading("clipped below", &["values are at the smallest", "bends at one level"], |run, random| {
        let level = random.random_range(0.05..0.3);
        run.reading.iter_mut().for_each(|x| *x = x.max(level));
        run.noise = 0.0;
    }),
    reading("drift", &["zero of the sensor drifts", "zero of the sensor wanders"], |run, random| {
        let slope = sign(random) * random.random_range(0.02..0.2) / run.reading.len() as f64;
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x += slope * k as f64);
    }),
    reading("temperature drift", &["zero of the sensor drifts", "zero of the sensor wanders"], |run, random| {
        let (size, period) = (random.random_range(0.02..0.1), random.random_range(40e3..200e3));
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x += size * (TAU * k as f64 / period).sin());
    }),
    reading(
        "random walk of the zero",
        &["zero of the sensor drifts", "zero of the sensor wanders", "the reading jumps", "no film explains"],
        |run, random| {
            let size = random.random_range(1e-4..5e-4);
            let mut zero = 0.0;
            run.reading.iter_mut().for_each(|x| {
                zero += size * random.random_range(-1.0..1.0);
                *x += zero;
            });
        },
    ),
    reading("mount slips once", &["the reading jumps"], |run, random| {
        let (from, size) = (middle(run, random), sign(random) * random.random_range(0.03..0.3));
        run.reading[from..].iter_mut().for_each(|x| *x += size);
    }),
    reading("mount slips three times", &["the reading jumps", "zero of the sensor"], |run, random| {
        for _ in 0..3 {
            let (from, size) = (middle(run, random), random.random_range(0.02..0.1));
            run.reading[from..].iter_mut().for_each(|x| *x += size);
        }
    }),
    reading(
        "slips at each top",
        &["slips in each cycle", "zero of the sensor drifts", "the reading jumps"],
        |run, random| {
            let share = random.random_range(0.02..0.06);
            let (mut slip, mut top): (f64, f64) = (0.0, 0.0);
            for x in &mut run.reading {
                if *x > top {
                    top = *x;
                } else if *x < 0.5 * top {
                    slip += share * top;
                    top = 0.0;
                }
                *x -= slip;
            }
        },
    ),
    reading("stuck for a while", &["not of the film", "same value"], |run, random| {
        let (from, length) = (middle(run, random), random.random_range(2000..12000));
        let value = run.reading[from];
        run.reading[from..from + length].fill(value);
    }),
    reading("stuck to the end", &["not of the film", "same value", "response to the drive changes"], |run, random| {
        let from = middle(run, random);
        let value = run.reading[from];
        run.reading[from..].fill(value);
    }),
    reading("50 Hz on the reading", &["interference of"], |run, random| {
        run.every = 4;
        let (hz, size) = (if random.random_bool(0.5) { 50.0 } else { 60.0 }, random.random_range(0.01..0.1));
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x += size * (TAU * hz * STEP_S * k as f64).sin());
    }),
    reading("50 Hz, aliased", &["whatever the drive does", "zero of the sensor wanders"], |run, random| {
        run.every = 20;
        let (hz, size) = (random.random_range(49.7..50.3), random.random_range(0.02..0.1));
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x += size * (TAU * hz * STEP_S * k as f64).sin());
    }),
    rows("lost rows", &["gap"], |run, random| run.rows.retain(|_| random.random_bool(0.9))),
    rows("lost rows that the clock does not show", &["shifted against each other", "drive jumps"], |run, random| {
        let (at, count) = (run.rows.len() / 2, random.random_range(20..200));
        run.under_the_clock(|rows| drop(rows.drain(at..at + count)));
    }),
    rows("lost readings on the sensor's side", &["shifted against each other"], |run, random| {
        let count = random.random_range(0.1..1.0) / (STEP_S * run.every as f64);
        let (at, count) = (run.rows.len() / 2, count as usize);
        for k in at..run.rows.len() - count {
            run.rows[k][2] = run.rows[k + count][2];
        }
        run.rows.truncate(run.rows.len() - count);
    }),
    rows("jitter of the clock", &["clock", "s apart: the model runs at"], |run, random| {
        let step_s = STEP_S * run.every as f64;
        run.rows.iter_mut().for_each(|row| row[0] += 0.45 * step_s * random.random_range(-1.0..1.0));
    }),
    rows("wrong clock rate in one recording", &["differ", "clock"], |run, random| {
        let factor = random.random_range(1.3..2.5);
        if run.number == 0 {
            run.rows.iter_mut().for_each(|row| row[0] *= factor);
        }
    }),
    reading("clocks that run apart", &["run apart"], |run, random| {
        let factor = 1.0 - random.random_range(2e-3..1e-2);
        let reading = run.reading.clone();
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x = reading[(factor * k as f64) as usize]);
    }),
    voltage("amplifier in its current limit", &["current limit", "behind its command"], |run, random| {
        let steepest = run.volts.windows(2).map(|v| (v[1] - v[0]).abs()).fold(0.0, f64::max);
        let most = random.random_range(0.3..0.8) * steepest;
        let mut value = 0.0;
        run.volts.iter_mut().for_each(|v| {
            value += (*v - value).clamp(-most, most);
            *v = value;
        });
    })
    .of_instrument(),
    voltage("amplifier saturated", &["amplifier at the end of its range", "bends at one level"], |run, random| {
        let level = random.random_range(0.6..0.9) * PEAK_V;
        run.volts.iter_mut().for_each(|v| *v = v.min(level));
    })
    .of_instrument(),
    voltage("monitor clipped", &["monitor at the end of its range"], |run, random| {
        let level = random.random_range(0.6..0.9) * PEAK_V;
        run.recorded_v.iter_mut().for_each(|v| *v = v.min(level));
    })
    .of_instrument(),
    voltage("amplifier lag", LATE, |run, random| {
        let lag_s = random.random_range(0.05..0.4);
        first_order(&mut run.volts, lag_s, lag_s);
    })
    .of_instrument(),
    voltage("missing bleeder", &["without a bleeder", "behind its command"], |run, random| {
        let fall_s = random.random_range(0.3..3.0);
        first_order(&mut run.volts, 0.01, fall_s);
    })
    .of_instrument(),
    reading("film fails half-way", &["response to the drive changes", "not of the film"], |run, random| {
        let (from, rest) = (middle(run, random), random.random_range(0.0..0.2));
        run.reading[from..].fill(rest);
    }),
    reading("film softens half-way", &["response to the drive changes"], |run, random| {
        let (from, gain) = (middle(run, random), 1.0 + random.random_range(0.1..0.5));
        run.reading[from..].iter_mut().for_each(|x| *x *= gain);
    }),
    voltage("arcs", ELSEWHERE, |run, random| {
        for _ in 0..3 {
            let (from, length) = (middle(run, random), random.random_range(100..1500));
            run.volts[from..from + length].fill(0.0);
        }
    }),
    rows("arcs in the sensor", &["drop-outs", "outliers"], |run, random| {
        let range = run.rows.iter().map(|row| row[2].abs()).fold(0.0, f64::max);
        for row in &mut run.rows {
            if random.random_bool(0.005) {
                row[2] += 3.0 * sign(random) * range;
            }
        }
    }),
    voltage("mains drop-out", ELSEWHERE, |run, random| {
        let (from, length) = (middle(run, random), random.random_range(500..8000));
        run.volts[from..from + length].fill(0.0);
    }),
    rows("quantised", &["resolves"], |run, random| {
        let (low, high) = run.range();
        let step = random.random_range(0.02..0.1) * (high - low);
        run.rows.iter_mut().for_each(|row| row[2] = (row[2] / step).round() * step);
    })
    .of_instrument(),
    reading("gain change", &["response to the drive changes"], |run, random| {
        let (from, gain) = (middle(run, random), random.random_range(0.6..0.9));
        run.reading[from..].iter_mut().for_each(|x| *x *= gain);
    }),
    reading("range of the sensor switched", &["response to the drive changes", "drop-outs"], |run, random| {
        let (from, gain) = (middle(run, random), if random.random_bool(0.5) { 10.0 } else { 0.1 });
        run.reading[from..].iter_mut().for_each(|x| *x *= gain);
    }),
    rows("reversed time", &["reversed order"], |run, _| {
        run.under_the_clock(|rows| rows.reverse());
    }),
    rows("shuffled rows", &["not in the order of time"], |run, random| {
        run.under_the_clock(|rows| {
            for k in (1..rows.len()).rev() {
                rows.swap(k, random.random_range(0..=k));
            }
        });
    }),
    rows("shuffled readings", &["no film explains"], |run, random| {
        for k in (1..run.rows.len()).rev() {
            let other = random.random_range(0..=k);
            (run.rows[k][2], run.rows[other][2]) = (run.rows[other][2], run.rows[k][2]);
        }
    }),
    rows(
        "duplicated blocks",
        &["again", "jumps", "repeat", "response to the drive changes", "not of the film"],
        |run, random| {
            let (at, count) = (run.rows.len() / 2, random.random_range(50..500));
            let block = run.rows[at..at + count].to_vec();
            run.rows.splice(at..at, block);
            let step_s = STEP_S * run.every as f64;
            run.rows.iter_mut().enumerate().for_each(|(k, row)| row[0] = k as f64 * step_s);
        },
    ),
    rows(
        "blocks in the wrong order",
        &["jump", "again", "response to the drive changes", "not of the film"],
        |run, _| {
            run.under_the_clock(|rows| {
                let third = rows.len() / 3;
                rows[third..].rotate_left(third);
            });
        },
    ),
    reading("sensor lag", LATE, |run, random| {
        let lag_s = random.random_range(0.05..0.5);
        first_order(&mut run.reading, lag_s, lag_s);
    })
    .of_instrument(),
    reading("sensor delay", LATE, |run, random| delayed(&mut run.reading, random.random_range(50..500)))
        .of_instrument(),
    voltage("slow monitor", &["a slow monitor"], |run, random| {
        let lag_s = random.random_range(0.05..0.4);
        first_order(&mut run.recorded_v, lag_s, lag_s);
    })
    .of_instrument(),
    voltage("monitor with a wrong zero", &["zero of the monitor"], |run, random| {
        let off_v = PEAK_V * random.random_range(0.004..0.012) * if random.random_bool(0.5) { 1.0 } else { -1.0 };
        run.recorded_v.iter_mut().for_each(|v| *v += off_v);
    })
    .of_instrument(),
    reading("stroke averaged about each row", &["smoothed without delay"], |run, random| {
        let (half, read) = (random.random_range(100..250), run.reading.clone());
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let rows = read.len();
        run.reading.iter_mut().enumerate().for_each(|(k, x)| {
            *x = mean(&read[k.saturating_sub(half)..(k + half + 1).min(rows)]);
        });
    })
    .of_instrument(),
    reading("sensor loses sight", ELSEWHERE, |run, random| {
        for _ in 0..2 {
            let (from, length) = (middle(run, random), random.random_range(500..4000));
            run.reading[from..from + length].fill(1.8);
        }
    }),
    reading("sensor that saturates", &["bends at one level"], |run, random| {
        let (knee, slope) = (random.random_range(0.5..0.8), random.random_range(0.1..0.6));
        run.reading.iter_mut().for_each(|x| *x = x.min(knee) + slope * (*x - knee).max(0.0));
    })
    .of_instrument(),
    reading(
        "another film in the middle",
        &["response to the drive changes", "jump", "not of the film"],
        |run, random| {
            let (from, other) = (middle(run, random), Film::random(random));
            let stroke = other.stroke(&run.volts, false);
            let gain = random.random_range(0.6..1.5);
            run.reading[from..].iter_mut().zip(&stroke[from..]).for_each(|(x, y)| *x = gain * y);
        },
    ),
    reading("another film in one recording", &["differ", "another film"], |run, random| {
        let other = Film::random(random);
        let gain = random.random_range(1.3..1.8);
        if run.number == 1 {
            run.reading = other.stroke(&run.volts, false);
            run.reading.iter_mut().for_each(|x| *x *= gain);
        }
    }),
    voltage("driven before", &["was driven before"], |run, _| run.driven_before = true),
    reading("warm-up of the sensor", &["warms up", "zero of the sensor"], |run, random| {
        let (size, tau) = (sign(random) * random.random_range(0.05..0.3), random.random_range(5e3..60e3));
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x += size * (-(k as f64) / tau).exp());
    }),
    reading("offsets that differ", &["differs between the recordings", "the reading jumps"], |run, random| {
        let zero = random.random_range(-0.3..0.3);
        run.reading.iter_mut().for_each(|x| *x += zero);
    }),
    reading("scales that differ", &["differ in scale"], |run, random| {
        // One recording alone has one scale.
        if run.number > 0 {
            let gain = random.random_range(0.6..1.4);
            run.reading.iter_mut().for_each(|x| *x *= gain);
        }
    }),
    voltage("hum on the voltage", &["hum or noise"], |run, random| {
        let size = random.random_range(0.03..0.15) * PEAK_V;
        run.recorded_v.iter_mut().enumerate().for_each(|(k, v)| *v += size * (TAU * 50.3e-3 * k as f64).sin());
    }),
    voltage("zero of the voltage", &["wrong zero", "in the first row"], |run, random| {
        let zero = sign(random) * random.random_range(0.05..0.2) * PEAK_V;
        run.recorded_v.iter_mut().for_each(|v| *v += zero);
    })
    .of_instrument(),
    voltage("dead band of the amplifier", &["dead band", "wrong zero"], |run, random| {
        let band = random.random_range(0.1..0.35) * PEAK_V;
        run.volts.iter_mut().for_each(|v| *v = (*v - band).max(0.0));
    })
    .of_instrument(),
    voltage("polarity switched", &[], |run, random| {
        let from = middle(run, random);
        run.recorded_v[from..].iter_mut().for_each(|v| *v = -*v);
    }),
    voltage(
        "amplifier of one polarity",
        &["one polarity", "not of the film", "response to the drive changes"],
        |run, random| {
            let from = middle(run, random);
            run.recorded_v[from..].iter_mut().for_each(|v| *v = -*v);
            run.volts[from..].fill(0.0);
        },
    ),
    reading("play in the mount", &["stays behind at each turn"], |run, random| {
        let (width, mut at) = (random.random_range(0.03..0.2), 0.0);
        run.reading.iter_mut().for_each(|x| {
            at = f64::clamp(at, *x - width, *x + width);
            *x = at;
        });
    })
    .of_instrument(),
    reading("resonance of the mount", &["Hz", "no film", "swings"], |run, random| {
        let (omega, mut at, mut speed) = (TAU * random.random_range(1.0..4.0), 0.0, 0.0);
        run.reading.iter_mut().for_each(|x| {
            speed += STEP_S * (omega * omega * (*x - at) - 0.04 * omega * speed);
            at += STEP_S * speed;
            *x = at;
        });
    })
    .of_instrument(),
    reading("response that fades", &["changes steadily", "response to the drive changes at"], |run, random| {
        let share = sign(random) * random.random_range(0.1..0.4) / run.reading.len() as f64;
        run.reading.iter_mut().enumerate().for_each(|(k, x)| *x *= 1.0 + share * k as f64);
    }),
    reading("strong noise", &["noise of"], |run, random| run.noise = random.random_range(0.05..0.2)),
    voltage("voltage of another run", &["no film explains", "not of the film"], |run, random| {
        let hz = random.random_range(0.05..0.5);
        run.recorded_v = (0..run.volts.len()).map(|k| sine(hz, PEAK_V, k as f64 * STEP_S)).collect();
    }),
    rows("zeros at the end", ELSEWHERE, |run, random| {
        let from = run.rows.len() - random.random_range(30..300);
        run.rows[from..].iter_mut().for_each(|row| row[2] = 0.0);
    }),
    rows("garbage in the first rows", ELSEWHERE, |run, random| {
        let (low, high) = run.range();
        let count = random.random_range(20..100);
        run.rows[..count].iter_mut().for_each(|row| row[2] = low + (high - low) * random.random_range(0.0..1.0));
    }),
    voltage(
        "voltage held between slow updates",
        &["recorded in steps", "slow monitor", "a new value of the drive"],
        |run, random| {
            let every = random.random_range(300..800);
            let recorded = run.recorded_v.clone();
            run.recorded_v.iter_mut().enumerate().for_each(|(k, v)| *v = recorded[k / every * every]);
        },
    )
    .of_instrument(),
    voltage("voltage of rounded kilovolts", &["recorded in steps"], |run, random| {
        let step = random.random_range(200.0..700.0);
        run.recorded_v.iter_mut().for_each(|v| *v = (*v / step).round() * step);
    }),
    rows("rounded times", &["clock", "uneven", "apart"], |run, random| {
        let step_s = STEP_S * run.every as f64;
        let coarse_s = step_s * random.random_range(3.0..8.0);
        run.rows.iter_mut().enumerate().for_each(|(k, row)| {
            row[0] = (k as f64 * step_s / coarse_s).floor() * coarse_s + 1e-5 * k as f64;
        });
    }),
    reading("starts again at the end of a range", &["starts again"], |run, random| {
        let range = random.random_range(0.4..0.8);
        run.reading.iter_mut().for_each(|x| *x = x.rem_euclid(range));
    }),
    rows("sensor slower than the rows", &["a new reading"], |run, random| {
        let each = random.random_range(4..40);
        for k in 0..run.rows.len() {
            run.rows[k][2] = run.rows[k - k % each][2];
        }
    }),
    reading("touched bench", &["for moments"], |run, random| {
        for _ in 0..3 {
            let (at, hz, size) = (middle(run, random), random.random_range(3.0..6.0), random.random_range(0.1..0.3));
            for (k, x) in run.reading.iter_mut().enumerate() {
                let t = STEP_S * (k as f64 - at as f64);
                *x += size * (-(t / 0.3).powi(2)).exp() * (TAU * hz * t).sin();
            }
        }
    }),
    reading("averaged by the recorder", LATE, |run, random| {
        let count = (random.random_range(0.1..0.5) / STEP_S) as usize;
        let mut sum = run.reading[0] * count as f64;
        let before = run.reading.clone();
        for k in 0..before.len() {
            sum += before[k] - before[k.saturating_sub(count)];
            run.reading[k] = sum / count as f64;
        }
    })
    .of_instrument(),
];
