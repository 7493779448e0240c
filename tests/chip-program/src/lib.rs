//! One program for host and target: builds laws, steps them, and reports checksums of every bit and what it cost.
//!
//! On the chip (`tests/embedded`) costs are counted instructions. On the host only the checksums matter, which must be
//! the chip's.
#![no_std]
#![forbid(unsafe_code)]

mod control;
pub mod tick;

use core::fmt;
use core::hint::black_box;

use springpot::{Actuator, Compressed, Law, Maxwell, Memory, Options, Preset, State, Topology, VoltageDrive};

/// Takes what the program reports.
pub trait Report {
    /// Runs `work` and reports what it cost.
    fn cost<R>(&mut self, name: Name, work: impl FnOnce() -> R) -> R;
    /// Runs `steps`, which makes so many steps, and reports what each cost beyond the loop in `idle`.
    fn cost_of_step(&mut self, name: Name, steps: u16, work: impl FnOnce(), idle: impl FnOnce());
    /// Reports a checksum.
    fn bits(&mut self, name: Name, checksum: Checksum);
}

/// What a report is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Name {
    /// The preset, such as `table3-n2`.
    pub preset: &'static str,
    /// How its branches are connected.
    pub topology: Topology,
    /// Head and modes of the law.
    pub size: &'static str,
    /// `law`, `creep`, `relaxation`, `voltage` (Eq. 1 from force to voltage), `feedforward`, `observer`, `tracking`, or `tick`
    /// (the whole control tick).
    pub what: &'static str,
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let topology = match self.topology {
            Topology::Eq11 => "eq11",
            Topology::Parallel => "parallel",
        };
        write!(f, "{}/{}/{}/{}", self.what, self.size, self.preset, topology)
    }
}

/// FNV-1a over the bits of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checksum(pub u64);

impl Default for Checksum {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Checksum {
    /// Adds the bits of `value` to the checksum.
    pub fn add(&mut self, value: f32) {
        for byte in value.to_bits().to_le_bytes() {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// A lean memory, true to 1e-4 over an hour.
pub type Lean = Compressed<f32, 8, 14, 4>;

/// The leanest: plain sums, true to 1e-4 over 155 s, forwards.
pub type Leanest = Compressed<f32, 8, 16, 0>;

/// Steps of every run.
pub const STEPS: u16 = 1000;

/// The program.
pub fn run(report: &mut impl Report) {
    for (preset, topology) in [
        ("table3-n1", Topology::Eq11),
        ("table3-n2", Topology::Eq11),
        ("table3-n5", Topology::Eq11),
        ("table3-n5", Topology::Parallel),
    ] {
        let model = Preset::named(preset).and_then(|preset| preset.model().ok());
        let Some(model) = model else { panic!("{} is no preset", preset) };
        let model = model.with_topology(topology);

        laws(report, preset, topology, &model);
        control::run(report, |what| Name { preset, topology, size: "12+36", what }, &model);
        tick::run(report, Name { preset, topology, size: "12+36", what: "tick" }, &model);
    }
}

/// Laws of `model`, default and lean: what they cost to build and to step.
#[inline(never)]
fn laws(report: &mut impl Report, preset: &'static str, topology: Topology, model: &Maxwell) {
    let name = |what| Name { preset, topology, size: "12+36", what };
    let options = Options::at_step(1e-3);
    let law = report.cost(name("law"), || Law::<f32>::compressed(black_box(model), options));
    let Ok(law) = law else { panic!("{} is refused", preset) };
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, name, &law, &law.state());
    voltage(report, name("voltage"), law.stiffness());

    let name = |what| Name { preset, topology, size: "8+18", what };
    let options = options.with_horizon(3600.0).with_tolerance(1e-3);
    let law = report.cost(name("law"), || Law::<f32, Lean>::compressed(black_box(model), options));
    let Ok(law) = law else { panic!("{} is refused", preset) };
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, name, &law, &law.state());

    let name = |what| Name { preset, topology, size: "8+16", what };
    let options = options.with_horizon(155.0);
    let law = report.cost(name("law"), || Law::<f32, Leanest>::compressed(black_box(model), options));
    let Ok(law) = law else { panic!("{} is refused", preset) };
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, name, &law, &law.state());
}

fn modes(modes: impl Iterator<Item = (f32, f32)>) -> Checksum {
    let mut checksum = Checksum::default();
    for (loss, weight) in modes {
        checksum.add(loss);
        checksum.add(weight);
    }
    checksum
}

/// Steps both directions, on data as they occur: a force of up to 100 N, a displacement of up to 1 mm.
fn step<M>(report: &mut impl Report, name: impl Fn(&'static str) -> Name, law: &Law<f32, M>, rest: &State<f32, M>)
where
    M: Memory<f32, History: Clone>,
{
    let square = |k: u16| f32::from(k) * f32::from(k);
    let mut run = |what, step: &mut dyn FnMut(u16) -> f32| {
        let mut checksum = Checksum::default();
        for k in 0..STEPS {
            checksum.add(step(k));
        }
        report.bits(name(what), checksum);
    };
    let mut state = rest.clone();
    run("creep", &mut |k| law.displacement(&mut state, 1e-4 * square(k)));
    let mut state = rest.clone();
    run("relaxation", &mut |k| law.force(&mut state, 1e-9 * square(k)));

    let mut state = rest.clone();
    report.cost_of_step(name("creep"), STEPS, || repeat(|k| creep(law, &mut state, 0.1 * k)), || repeat(|k| 0.1 * k));
    let mut state = rest.clone();
    report.cost_of_step(
        name("relaxation"),
        STEPS,
        || repeat(|k| relaxation(law, &mut state, 1e-6 * k)),
        || repeat(|k| 1e-6 * k),
    );
}

fn voltage(report: &mut impl Report, name: Name, stiffness: f32) {
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, stiffness);
    let Ok(drive) = drive else { panic!("the paper's actuator is refused") };
    let mut checksum = Checksum::default();
    for k in 0..STEPS {
        checksum.add(voltage_of(&drive, 0.1 * f32::from(k)));
    }
    report.bits(name, checksum);
    report.cost_of_step(name, STEPS, || repeat(|k| voltage_of(&drive, 0.1 * k)), || repeat(|k| 0.1 * k));
}

#[inline(never)]
fn voltage_of(drive: &VoltageDrive<f32>, force: f32) -> f32 {
    drive.voltage(force, 0.001)
}

#[inline(always)]
fn repeat(mut step: impl FnMut(f32) -> f32) {
    for k in 0..STEPS {
        black_box(step(black_box(f32::from(k))));
    }
}

#[inline(never)]
fn creep<M: Memory<f32>>(law: &Law<f32, M>, state: &mut State<f32, M>, force: f32) -> f32 {
    law.displacement(state, force)
}

#[inline(never)]
fn relaxation<M: Memory<f32>>(law: &Law<f32, M>, state: &mut State<f32, M>, displacement: f32) -> f32 {
    law.force(state, displacement)
}
