//! Jobs: a law or a law of control along given inputs, in Rust and for the C of `tests/c/job.h`.

use springpot::{
    Adapted, Adapting, Applied, Compensator, FilmReading, Follower, FollowerState, SelfSensing, SelfSensingFault,
    SensorSample, TemperatureDependence, Tracking, VoltageCommand,
};

use crate::films::Case;

/// The law that is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Kind {
    Displacement = 0,
    Force = 1,
    Feedforward = 2,
    Observer = 3,
    Tracking = 4,
    Learning = 5,
    SelfSensing = 6,
}

impl Kind {
    pub const ALL: [Self; 7] = [
        Self::Displacement,
        Self::Force,
        Self::Feedforward,
        Self::Observer,
        Self::Tracking,
        Self::Learning,
        Self::SelfSensing,
    ];
}

/// The input of a step: a force, a displacement, a voltage or a reference; a second number, of self-sensing a current; a sample; orders.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    pub a: f32,
    pub b: f32,
    pub sample: Option<SensorSample<f32>>,
    pub flags: u32,
}

impl Input {
    /// The temperature that is ordered where the film was fitted at several, °C.
    pub fn celsius(&self) -> f32 {
        20.0 + 3_000.0 * self.a
    }
}

/// Orders about a film that changes: flags beside those of [`follow`].
pub const LEARN: u32 = 512;
pub const HOLD: u32 = 1024;
pub const OFF: u32 = 2048;
pub const RESTORE: u32 = 4096;
pub const FORGET_CHANGES: u32 = 8192;
pub const TEMPERATURE: u32 = 16384;

/// The output of a step: five numbers by their bits, and flags or a count.
pub type Row = [u32; 6];

/// The job for the C program: film `index`.
pub fn bytes(kind: Kind, index: usize, inputs: &[Input]) -> Vec<u8> {
    let word = |value: usize| u32::try_from(value).expect("few");
    let mut words = vec![kind as u32, word(index), word(inputs.len())];
    for Input { a, b, sample, flags } in inputs {
        let (displacement, age) = sample.map_or((0.0, u32::MAX), |s| (s.displacement_m, word(s.age_ticks)));
        words.extend([a.to_bits(), b.to_bits(), displacement.to_bits(), age, *flags]);
    }
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// The rows that the C program wrote.
pub fn rows(bytes: &[u8]) -> Vec<Row> {
    let (rows, rest) = bytes.as_chunks::<24>();
    assert!(rest.is_empty(), "the program ended within a row");
    rows.iter()
        .map(|row| {
            let (words, _) = row.as_chunks::<4>();
            std::array::from_fn(|k| u32::from_le_bytes(words[k]))
        })
        .collect()
}

/// The share of a command that is put out, NaN where it is not known.
fn put_out(input: &Input) -> f32 {
    match input.flags & 12 {
        0 => 1.0,
        4 => 0.5,
        _ => f32::NAN,
    }
}

/// Five numbers and a word.
fn row(numbers: [f32; 5], last: u32) -> Row {
    let [a, b, c, d, e] = numbers.map(f32::to_bits);
    [a, b, c, d, e, last]
}

/// Variance of samples of a second sensor, m².
const VARIANCE_M2: f32 = 1e-10;

/// Self-sensing along `inputs`: the number of a fault in the last word, with the age of a sample if there is one.
fn sense(sensing: &SelfSensing<f32>, inputs: &[Input]) -> Vec<Row> {
    let mut state = sensing.state();
    let mut tick = |input: &Input| {
        if input.flags & 1 != 0 {
            state = sensing.state();
        }
        if let Some(sample) = input.sample {
            sensing.correct(&mut state, sample, VARIANCE_M2);
        }
        let sensed = sensing.sense(&mut state, FilmReading { voltage_v: input.a, current_a: input.b });
        let fault = match state.fault() {
            None => 0,
            Some(SelfSensingFault::NoTone) => 1,
            Some(SelfSensingFault::Shorted) => 2,
            Some(SelfSensingFault::CurrentMonitor) => 3,
            Some(_) => 4,
        };
        let age = sensed.map_or(0, |sensed| u32::try_from(sensed.sample.age_ticks).expect("few"));
        let (drive, tone) = (state.drive_v(), sensing.drive(&state, input.a));
        match sensed {
            Some(sensed) => {
                let numbers = [
                    sensed.sample.displacement_m,
                    sensed.uncertainty_m(),
                    sensed.capacitance_f,
                    sensed.resistance_ohm,
                    tone,
                ];
                row(numbers, fault + 16 * age)
            }
            None => row([drive, state.offset_m(), 0.0, 0.0, tone], fault),
        }
    };
    inputs.iter().map(&mut tick).collect()
}

/// The same by the Rust laws.
pub fn run(kind: Kind, case: &Case, inputs: &[Input]) -> Vec<Row> {
    let Case { law, feedforward, tracking, learning, .. } = case;
    let mut state = law.state();
    match kind {
        Kind::Displacement => inputs
            .iter()
            .map(|input| {
                let x = law.displacement(&mut state, input.a);
                let to = law.force_to(&state, 1.001 * x);
                // In the middle of a creep it is held for a step.
                let held = if input.flags != 0 { law.force(&mut state, x) } else { 0.0 };
                row([x, state.base_force(), state.increment(), to, held], u32::from(state.beyond_curve()))
            })
            .collect(),
        Kind::Force => inputs
            .iter()
            .map(|input| {
                let to = law.force_to(&state, input.b);
                let force = law.force(&mut state, input.a);
                if input.flags != 0 {
                    state.move_origin(input.b);
                }
                let numbers = [force, state.base_force(), state.increment(), to, state.position()];
                row(numbers, u32::from(state.beyond_curve()))
            })
            .collect(),
        Kind::Feedforward => {
            let follower = Follower::new(feedforward.clone());
            follow(
                &follower,
                state,
                inputs,
                |_, _| (),
                |state, x, command| {
                    let behind = state.compensator().film_voltage();
                    row(
                        [x, command.voltage_v, command.reference_m, command.force_n, behind],
                        command.limited.bits().into(),
                    )
                },
            )
        }
        Kind::Observer => {
            let observer = tracking.observer();
            let mut state = observer.state(state);
            inputs
                .iter()
                .map(|input| {
                    let x = observer.observe(&mut state, Applied::as_commanded(input.a), input.sample);
                    let statistics = state.statistics();
                    let numbers =
                        [x, state.disturbance(), state.force_scale(), statistics.mean(), statistics.variance()];
                    row(numbers, state.ticks_since_sample())
                })
                .collect()
        }
        Kind::SelfSensing => sense(&case.sensed.as_ref().expect("it is sensed").sensing, inputs),
        Kind::Tracking | Kind::Learning => {
            let follower: Follower<f32, _> = Follower::new(tracking.clone());
            let follower = match learning {
                Some(learning) if kind == Kind::Learning => follower.with_learning(*learning),
                _ => follower,
            };
            let adapt = |state: &mut _, input: &_| adapt(state, input, case.temperature.as_ref());
            follow(&follower, state, inputs, adapt, |state, x, command| {
                let observer = state.observer();
                let adapted = state.compensator().adapted();
                let Adapted { force_scale, uncertainty, memory, rate, stretch, bias_n, ageing } = adapted;
                let change = state.compensator().stiffness_change();
                let seen = [observer.share(), force_scale, uncertainty, memory, rate, stretch, bias_n, change];
                let seen = seen.iter().fold(0, |all, number| all ^ number.to_bits());
                let third = if kind == Kind::Learning { state.added() } else { ageing };
                let numbers = [x, command.voltage_v, third, observer.disturbance(), f32::from_bits(seen)];
                row(numbers, command.limited.bits().into())
            })
        }
    }
}

/// An order about a film that changes.
fn adapt(state: &mut FollowerState<f32, Tracking<f32>>, input: &Input, temperature: Option<&TemperatureDependence>) {
    match input.flags & !14 {
        LEARN => state.set_adapting(Adapting::Learn),
        HOLD => state.set_adapting(Adapting::Hold),
        OFF => state.set_adapting(Adapting::Off),
        RESTORE => {
            let adapted = Adapted {
                force_scale: 0.9 * input.b,
                uncertainty: 0.01,
                memory: 0.1,
                rate: -0.4,
                stretch: 220.0 * input.a,
                bias_n: 0.02,
                ageing: 0.25,
            };
            // Refused without a reading, and of a reference beyond a bound.
            let _ = state.restore(&adapted);
        }
        FORGET_CHANGES => state.forget_changes(),
        TEMPERATURE => {
            let factors = match temperature {
                Some(dependence) => {
                    let celsius = f64::from(input.celsius());
                    [dependence.stiffness_factor(celsius), dependence.time_factor(celsius)].map(|factor| factor as f32)
                }
                None => [0.8 * input.b, 700.0 * input.a],
            };
            // As what is restored.
            let _ = state.set_temperature_factors(factors[0], factors[1]);
        }
        _ => {}
    }
}

/// Steps `follower` along `inputs`: a row of each tick from its state, estimate and command.
fn follow<C: Compensator<f32>>(
    follower: &Follower<f32, C>,
    film: C::Film,
    inputs: &[Input],
    adapt: impl Fn(&mut FollowerState<f32, C>, &Input),
    row: impl Fn(&FollowerState<f32, C>, f32, &VoltageCommand<f32>) -> Row,
) -> Vec<Row> {
    let mut state = follower.state(film);
    let (mut commanded, mut is_even) = (0.0, false);
    let mut tick = |input: &Input| {
        let stands_by = input.flags & 2 != 0;
        // An order at a time.
        match input.flags & !14 {
            0 => {}
            1 => state.forget_correction(),
            16 => state.carry_over(),
            32 => state.end_run(),
            64 => state.forget_cycles(),
            128 => state.set_feedback(false),
            256 => state.set_feedback(true),
            LEARN | HOLD | OFF | RESTORE | FORGET_CHANGES | TEMPERATURE => adapt(&mut state, input),
            other => panic!("{other} is no order"),
        }
        let applied = commanded * put_out(input);
        let applied = Applied { commanded_v: applied, reading_v: Some(input.b * applied) };
        // One call and two phases in turn.
        is_even = !is_even;
        let command = if is_even && !stands_by {
            follower.step(&mut state, applied, input.sample, input.a)
        } else {
            let x = follower.observe(&mut state, applied, input.sample);
            assert_eq!(x.to_bits(), state.displacement().to_bits());
            if stands_by { follower.standby(&mut state) } else { follower.command(&mut state, input.a) }
        };
        commanded = command.voltage_v;
        row(&state, state.displacement(), &command)
    };
    inputs.iter().map(&mut tick).collect()
}
