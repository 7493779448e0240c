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

use springpot::{
    Actuator, CapacitanceRelation, Compressed, Curve, Discretisation, Law, LawOptions, LawState, Maxwell, Measure,
    Memory, Preset, Spring, Topology, VoltageDrive,
};

/// Takes what the program reports.
pub trait Report {
    /// Runs `work` and reports what it cost.
    fn cost<R>(&mut self, name: Name, work: impl FnOnce() -> R) -> R;
    /// Runs `steps`, which makes so many steps, and reports what each cost beyond the loop in `idle`.
    fn cost_of_step(&mut self, name: Name, steps: u16, work: impl FnOnce(), idle: impl FnOnce());
    /// Reports a checksum.
    fn bits(&mut self, name: Name, checksum: Checksum);
}

/// A film that the program steps, and how its law is discretised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// The preset, such as `table3-n2`.
    pub preset: &'static str,
    /// How its branches are connected.
    pub topology: Topology,
    /// How s is discretised.
    pub method: Discretisation,
    /// Step of its law, s.
    pub step_s: f64,
    /// The curves of its law, on an actuator that saturates if there are any.
    pub curves: Curves,
}

/// Curves of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Curves {
    /// Linear film.
    None,
    /// An elastic curve of as many pieces as there may be before the memory.
    Before,
    /// A spring beside the memory, which has a strain measure of its own: eight pieces each.
    Beside,
    /// That spring in series with the memory.
    Series,
}

/// The films of the program.
pub const FILMS: [Film; 12] = [
    Film::from_preset("table3-n1", Topology::Eq11),
    Film::from_preset("table3-n2", Topology::Eq11),
    Film::from_preset("table3-n5", Topology::Eq11),
    Film::from_preset("table3-n5", Topology::Parallel),
    Film { method: Discretisation::Bdf2, ..Film::from_preset("table3-n2", Topology::Eq11) },
    Film::with_curves(Curves::Before, Discretisation::Gl),
    Film::with_curves(Curves::Before, Discretisation::Bdf2),
    Film::with_curves(Curves::Beside, Discretisation::Gl),
    Film::with_curves(Curves::Beside, Discretisation::Bdf2),
    Film { method: Discretisation::Bdf2, step_s: SLOW_S, ..Film::from_preset("table3-n2", Topology::Eq11) },
    Film::with_curves(Curves::Series, Discretisation::Gl),
    Film::with_curves(Curves::Series, Discretisation::Bdf2),
];

/// Films of each kind: stepped by either method, straight, behind a curve and with a spring, fast and slow. With a spring a tick is built in more than 16 KiB: slow ones have none here. All of them take a chip without an FPU
/// minutes, in which laws are built in f64.
pub const FEW: [Film; 5] =
    [FILMS[1], FILMS[6], FILMS[9], Film { step_s: SLOW_S, ..FILMS[8] }, Film { step_s: SLOW_S, ..FILMS[11] }];

/// The same for a chip with an FPU, which has room for a tick with a spring.
pub const FEW_WITH_FPU: [Film; 7] = [FEW[0], FEW[1], FEW[2], FEW[3], FEW[4], FILMS[7], FILMS[10]];

/// All films for a chip of 16 KiB, which cannot build a tick with a spring: slow ones have none here.
pub const SMALL: [Film; 10] =
    [FILMS[0], FILMS[1], FILMS[2], FILMS[3], FILMS[4], FILMS[5], FILMS[6], FILMS[9], FEW[3], FEW[4]];

/// Step of a controller without an FPU, s.
const SLOW_S: f64 = 1e-2;

impl Film {
    const fn from_preset(preset: &'static str, topology: Topology) -> Self {
        Self { preset, topology, method: Discretisation::Gl, step_s: 1e-3, curves: Curves::None }
    }

    const fn with_curves(curves: Curves, method: Discretisation) -> Self {
        Self { curves, method, ..Self::from_preset("table3-n2", Topology::Eq11) }
    }

    #[inline(never)]
    fn model(self) -> Maxwell {
        let model = Preset::named(self.preset).and_then(|preset| preset.model().ok());
        let Some(model) = model else { panic!("{} is no preset", self.preset) };
        model.with_topology(self.topology)
    }

    /// The default law of `model` at its step, with its curves.
    fn law(self, model: &Maxwell) -> Law<f32> {
        self.bent(self.straight_law(model))
    }

    // Built and bent one after the other, each with a stack of its own: the small chip has 16 KiB for all.
    #[inline(never)]
    fn straight_law(self, model: &Maxwell) -> Law<f32> {
        let law = Law::compressed(model, LawOptions::at_step(self.step_s).with_method(self.method));
        let Ok(law) = law else { panic!("{} is refused", self.preset) };
        law
    }

    /// `law` with the curves of this film.
    ///
    /// # Panics
    ///
    /// If it is refused.
    #[inline(never)]
    #[must_use]
    pub fn bent(self, law: Law<f32>) -> Law<f32> {
        let bent = match self.curves {
            Curves::None => Ok(law),
            Curves::Before => law.behind(&curve()),
            Curves::Beside => law.beside(&spring(), &measure()),
            Curves::Series => law.in_series(&spring()),
        };
        let Ok(law) = bent else { panic!("the law with curves is refused") };
        law
    }

    /// The actuator of this film.
    #[must_use]
    pub fn actuator(self) -> Actuator {
        if self.is_curved() { SATURATING } else { Actuator::KARNER_2022 }
    }

    /// Whether its law has curves.
    #[must_use]
    pub fn is_curved(self) -> bool {
        self.curves != Curves::None
    }
}

/// A strain measure of 8 pieces over the stroke of the curve: of a film that is short, so that it bends.
#[must_use]
pub fn measure() -> Curve {
    let Ok(curve) = (Measure { exponent: 0.0, length_m: 0.01 }).curve(-4e-4, 1.2e-3) else { panic!("refused") };
    curve
}

/// A spring of 8 pieces over the stroke of the curve: a tenth of the memory's stiffness within a step, and softer the further it is stretched.
#[must_use]
pub fn spring() -> Spring {
    let points = core::array::from_fn::<_, 9, _>(|k| {
        #[allow(clippy::cast_precision_loss)] // up to 8
        let x = 2e-4 * (k as f64 - 2.0);
        (x, 2e4 * x * (1.0 - 200.0 * x))
    });
    let Ok(spring) = Spring::through(&points) else { panic!("the spring is refused") };
    spring
}

/// The paper's actuator, with a force that saturates.
pub const SATURATING: Actuator = Actuator { saturation_v: Some(9000.0), ..Actuator::KARNER_2022 };

/// A curve of 16 pieces, from −0.5 mm to 1.1 mm: softer by a tenth at first, then half as stiff again. Steps go beyond its end.
#[must_use]
pub fn curve() -> Curve {
    let points = core::array::from_fn::<_, 17, _>(|k| {
        #[allow(clippy::cast_precision_loss)] // up to 16
        let x = 1e-4 * (k as f64 - 5.0);
        (x, x * (1.0 + x * (3e5 * x - 300.0)))
    });
    let Ok(curve) = Curve::through(&points) else { panic!("the curve is refused") };
    curve
}

/// Displacement of a film of 700 to 900 pF, which creeps at a constant capacitance.
#[must_use]
pub fn relation() -> CapacitanceRelation {
    CapacitanceRelation { creep: 0.05, ..CapacitanceRelation::of_geometry(700e-12, 0.06, 2.0, 900e-12) }
}

/// Subject of a report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Name {
    /// The film.
    pub film: Film,
    /// Head and modes of the law.
    pub size: &'static str,
    /// `law`, `creep`, `relaxation`, `voltage` (Eq. 1 from force to voltage), `feedforward`, `observer`, `tracking`, or `tick`
    /// (the whole control tick).
    pub what: &'static str,
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { film, size, what } = self;
        let curves = match film.curves {
            Curves::None => "",
            Curves::Before => "+curve",
            Curves::Beside => "+curves",
            Curves::Series => "+series",
        };
        let method = if film.method == Discretisation::Bdf2 { "/bdf2" } else { "" };
        let topology = match film.topology {
            Topology::Eq11 => "eq11",
            Topology::Parallel => "parallel",
        };
        let rate = if film.step_s == SLOW_S { "/100hz" } else { "" };
        write!(f, "{what}/{size}{curves}/{}/{topology}{method}{rate}", film.preset)
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

/// Steps of every run.
pub const STEPS: u16 = 1000;

/// The program, for these films.
pub fn run(report: &mut impl Report, films: &[Film]) {
    for &film in films {
        let model = film.model();
        let name = |what| Name { film, size: "12+36", what };

        if film.is_curved() || film.method != Discretisation::Gl {
            default_law(report, name, &model);
        } else {
            laws(report, film, &model);
        }
        if film.step_s == SLOW_S {
            if !film.is_curved() {
                lean_law(report, |what| Name { film, size: "8+18", what }, &model);
            }
            continue;
        }
        control::run(report, name, &model);
        tick::run(report, name("tick"), &model);
    }
}

/// The default law of `model`: what it costs to step.
#[inline(never)]
fn default_law(report: &mut impl Report, name: impl Fn(&'static str) -> Name, model: &Maxwell) {
    let law = name("law").film.law(model);
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, &name, &law);
    voltage(report, name("voltage"), law.min_stiffness());
}

/// The lean law of `model`: what it costs to step.
#[inline(never)]
fn lean_law(report: &mut impl Report, name: impl Fn(&'static str) -> Name, model: &Maxwell) {
    let Film { step_s, method, .. } = name("law").film;
    let options = LawOptions::at_step(step_s).with_method(method).with_horizon(3600.0).with_tolerance(1e-3);
    let Ok(law) = Law::<f32, Compressed<f32, 8, 14, 4>>::compressed(model, options) else {
        panic!("{} is refused", name("law"))
    };
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, &name, &law);
}

/// Laws of `model`, default and lean: what they cost to build and to step. Each has a stack of its own.
fn laws(report: &mut impl Report, film: Film, model: &Maxwell) {
    let options = LawOptions::at_step(1e-3);
    law::<12, 12, 24>(report, |what| Name { film, size: "12+36", what }, model, options);
    let options = options.with_horizon(3600.0).with_tolerance(1e-3);
    // A lean memory, true to 1e-4 over an hour.
    law::<8, 14, 4>(report, |what| Name { film, size: "8+18", what }, model, options);
    // The leanest: plain sums, true to 1e-4 over 155 s, forwards.
    law::<8, 16, 0>(report, |what| Name { film, size: "8+16", what }, model, options.with_horizon(155.0));
}

#[inline(never)]
fn law<const HEAD: usize, const FAST: usize, const SLOW: usize>(
    report: &mut impl Report,
    name: impl Fn(&'static str) -> Name,
    model: &Maxwell,
    options: LawOptions,
) {
    let law = report
        .cost(name("law"), || Law::<f32, Compressed<f32, HEAD, FAST, SLOW>>::compressed(black_box(model), options));
    let Ok(law) = law else { panic!("{} is refused", name("law")) };
    report.bits(name("law"), modes(law.memory().modes()));
    step(report, &name, &law);
    if name("law").size == "12+36" {
        voltage(report, name("voltage"), law.stiffness());
    }
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
#[inline(never)]
fn step<const HEAD: usize, const FAST: usize, const SLOW: usize>(
    report: &mut impl Report,
    name: impl Fn(&'static str) -> Name,
    law: &Law<f32, Compressed<f32, HEAD, FAST, SLOW>>,
) {
    let square = |k: u16| f32::from(k) * f32::from(k);
    let mut run = |what, step: &mut dyn FnMut(u16) -> f32| {
        let mut checksum = Checksum::default();
        for k in 0..STEPS {
            checksum.add(step(k));
        }
        report.bits(name(what), checksum);
    };
    let mut state = law.state();
    run("creep", &mut |k| law.displacement(&mut state, 1e-4 * square(k)));
    let mut state = law.state();
    run("relaxation", &mut |k| law.force(&mut state, 1e-9 * square(k)));

    let mut state = law.state();
    report.cost_of_step(name("creep"), STEPS, || repeat(|k| creep(law, &mut state, 0.1 * k)), || repeat(|k| 0.1 * k));
    let mut state = law.state();
    report.cost_of_step(
        name("relaxation"),
        STEPS,
        || repeat(|k| relaxation(law, &mut state, 1e-6 * k)),
        || repeat(|k| 1e-6 * k),
    );
}

fn voltage(report: &mut impl Report, name: Name, stiffness: f32) {
    let drive = VoltageDrive::new(&name.film.actuator(), 6000.0, stiffness);
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
fn creep<M: Memory<f32>>(law: &Law<f32, M>, state: &mut LawState<f32, M>, force: f32) -> f32 {
    law.displacement(state, force)
}

#[inline(never)]
fn relaxation<M: Memory<f32>>(law: &Law<f32, M>, state: &mut LawState<f32, M>, displacement: f32) -> f32 {
    law.force(state, displacement)
}
