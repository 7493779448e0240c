//! Calls every kernel, for a trace of its instructions: `cargo xtask embedded` models the cycles from it.
//!
//! It says before and after each kernel that the trace begins and ends there, so that the trace holds little else.
#![no_std]
#![no_main]

use core::hint::black_box;

use chip_program::tick;
use dea_driver::Controller;
use dea_driver::chips::DacCode;
use semihosting::fs::remove_file;
use semihosting::{println, process};
use springpot::{
    Actuator, Applied, Coefficients, CommandLimits, Compressed, Feedforward, FeedforwardState, Law, LawState, Observer,
    ObserverOptions, ObserverState, SensorSample, Tracking, TrackingState, VoltageDrive,
};

include!(concat!(env!("OUT_DIR"), "/coefficients.rs"));

const STEP_S: f64 = 1e-3;
const MASS_KG: f64 = Actuator::KARNER_2022.mass_kg;

type LeanLaw = Law<f32, Compressed<f32, 8, 14, 4>>;
type LeanestLaw = Law<f32, Compressed<f32, 8, 16, 0>>;
type LeanestState = LawState<f32, Compressed<f32, 8, 16, 0>>;
type LeanState = LawState<f32, Compressed<f32, 8, 14, 4>>;

/// Calls a function of this name, whose instructions the trace finds by it; the last call counts. Two functions of equal
/// instructions would become one: those of one law with and without a curve are called with different numbers.
macro_rules! kernel {
    ($name:ident, |$config:ident: $Config:ty, $state:ident: $State:ty| $body:expr, $with:expr) => {{
        let (config, mut state) = $with;
        #[unsafe(no_mangle)]
        #[inline(never)]
        fn $name($config: &$Config, $state: &mut $State) {
            black_box($body);
        }
        traced(|| (0..2).for_each(|_| $name(black_box(&config), black_box(&mut state))));
    }};
}

/// Runs a kernel once its trace has begun: then there is a file, within far fewer tries.
fn traced(kernel: impl FnOnce()) {
    // At the beginning of a line, whatever the monitor echoes meanwhile.
    println!("\nbegin");
    let has_begun = (0..10_000_000).any(|_| remove_file(c"go").is_ok());
    assert!(has_begun, "there is no trace");
    kernel();
    println!("\nend");
}

fn built<T, E>(result: Result<T, E>) -> T {
    match result {
        Ok(built) => built,
        Err(_) => panic!("refused"),
    }
}

fn sample() -> Option<SensorSample<f32>> {
    black_box(Some(SensorSample { displacement_m: 1e-4, age_ticks: 10 }))
}

fn applied() -> Applied<f32> {
    black_box(Applied::as_commanded(1000.0))
}

#[cfg_attr(target_arch = "arm", cortex_m_rt::entry)]
#[cfg_attr(target_arch = "riscv32", riscv_rt::entry)]
fn main() -> ! {
    let law: Law<f32> = built(Law::from_coefficients(&default_law(), STEP_S, MASS_KG));
    let lean: LeanLaw = built(Law::from_coefficients(&lean_law(), STEP_S, MASS_KG));
    let film = || (law.clone(), law.state());
    kernel!(creep_12_36, |law: Law<f32>, film: LawState<f32>| law.displacement(film, black_box(10.0)), film());
    kernel!(relaxation_12_36, |law: Law<f32>, film: LawState<f32>| law.force(film, black_box(1e-4)), film());
    let curved: Law<f32> = built(Law::from_coefficients(&curved_law(), STEP_S, MASS_KG));
    let film = || (curved.clone(), curved.state());
    kernel!(creep_12_36_curve, |law: Law<f32>, film: LawState<f32>| law.displacement(film, black_box(9.0)), film());
    kernel!(relaxation_12_36_curve, |law: Law<f32>, film: LawState<f32>| law.force(film, black_box(9e-5)), film());
    let two: Law<f32> = built(Law::from_coefficients(&two_curves_law(), STEP_S, MASS_KG));
    let film = || (two.clone(), two.state());
    kernel!(creep_12_36_curves, |law: Law<f32>, film: LawState<f32>| law.displacement(film, black_box(8.0)), film());
    kernel!(relaxation_12_36_curves, |law: Law<f32>, film: LawState<f32>| law.force(film, black_box(8e-5)), film());
    let series: Law<f32> = built(Law::from_coefficients(&series_law(), STEP_S, MASS_KG));
    let film = || (series.clone(), series.state());
    kernel!(creep_12_36_series, |law: Law<f32>, film: LawState<f32>| law.displacement(film, black_box(7.0)), film());
    kernel!(relaxation_12_36_series, |law: Law<f32>, film: LawState<f32>| law.force(film, black_box(7e-5)), film());
    let film = || (lean.clone(), lean.state());
    kernel!(creep_8_18, |law: LeanLaw, film: LeanState| law.displacement(film, black_box(10.0)), film());
    kernel!(relaxation_8_18, |law: LeanLaw, film: LeanState| law.force(film, black_box(1e-4)), film());
    let leanest: LeanestLaw = built(Law::from_coefficients(&leanest_law(), STEP_S, MASS_KG));
    let film = || (leanest.clone(), leanest.state());
    kernel!(creep_8_16, |law: LeanestLaw, film: LeanestState| law.displacement(film, black_box(10.0)), film());
    kernel!(relaxation_8_16, |law: LeanestLaw, film: LeanestState| law.force(film, black_box(1e-4)), film());

    let actuator = &Actuator::KARNER_2022;
    let drive: VoltageDrive<f32> = built(VoltageDrive::new(actuator, 6000.0, law.stiffness()));
    kernel!(voltage, |drive: VoltageDrive<f32>, force: f32| drive.voltage(*force, black_box(1e-4)), (drive, 10.0));

    let (limits, options) = (CommandLimits::BENCH, ObserverOptions::at_bandwidth(0.6));
    let config: Feedforward<f32> = built(Feedforward::new(law.clone(), actuator, limits));
    let state = config.state(law.state());
    kernel!(
        feedforward,
        |config: Feedforward<f32>, state: FeedforwardState<f32>| {
            config.apply(state, applied());
            config.command(state, black_box(1e-4))
        },
        (config, state)
    );
    let config: Observer<f32> = built(Observer::new(law.clone(), actuator, 6000.0, options));
    let state = config.state(law.state());
    kernel!(
        observer,
        |config: Observer<f32>, state: ObserverState<f32>| config.observe(state, applied(), sample()),
        (config, state)
    );
    let config: Tracking<f32> = built(Tracking::new(law.clone(), actuator, limits, options));
    let state = config.state(law.state());
    kernel!(
        tracking,
        |config: Tracking<f32>, state: TrackingState<f32>| {
            config.observe(state, applied(), sample());
            config.command(state, black_box(1e-4))
        },
        (config, state)
    );
    let controller = tick::running(&default_law(), Actuator::KARNER_2022);
    kernel!(
        tick,
        |command: DacCode, controller: Controller| tick::tick(controller, *command),
        (DacCode::ZERO, controller)
    );
    let controller = tick::running(&curved_law(), chip_program::SATURATING);
    kernel!(
        tick_curve,
        |command: DacCode, controller: Controller| tick::tick(controller, black_box(*command)),
        (DacCode::ZERO, controller)
    );
    let controller = tick::running(&two_curves_law(), chip_program::SATURATING);
    kernel!(
        tick_curves,
        |command: DacCode, controller: Controller| black_box(tick::tick(controller, black_box(*command))),
        (DacCode::ZERO, controller)
    );
    let controller = tick::running(&series_law(), chip_program::SATURATING);
    kernel!(
        tick_series,
        |command: DacCode, controller: Controller| tick::tick(controller, black_box(black_box(*command))),
        (DacCode::ZERO, controller)
    );
    process::exit(0)
}
