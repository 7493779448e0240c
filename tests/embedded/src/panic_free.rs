//! Links only if neither a step of a law nor a control tick can panic: the panic handler calls what does not exist, and the
//! linker looks for it only if something reaches the handler.
//!
//! Built, never run. With the feature `can-panic` it must not link, which shows that the proof can fail.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use dea_driver::chips::{AdcCode, AdcRange};
use dea_driver::{Device, Inputs};
use springpot::{
    Adapting, Applied, Compressed, FilmReading, Law, LawState, Learning, LearningState, Limited, Memory, SelfSensing,
    SelfSensingState, SensorSample, Tracking, TrackingState, VoltageDrive,
};

unsafe extern "C" {
    fn a_step_or_a_tick_can_panic() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    // SAFETY: there is no such function, so nothing that links gets here.
    unsafe { a_step_or_a_tick_can_panic() }
}

/// Some value that was built elsewhere: building may fail, and is not what is looked at here.
fn built<T>() -> &'static mut T {
    // SAFETY: never run.
    unsafe { &mut *black_box(0x2000_0000 as *mut T) }
}

/// The law may be behind any curve or none: both ways must be without a panic.
fn step<M: Memory<f32, History: 'static> + 'static>() {
    let (law, state) = (built::<Law<f32, M>>(), built::<LawState<f32, M>>());
    let drive = built::<VoltageDrive<f32>>();
    let load = drive.load(black_box(1.0));
    let x = law.displacement_under(state, load);
    let force =
        law.force(state, black_box(x)) + law.force_to(state, black_box(1.0)) + law.displacement(state, black_box(1.0));
    black_box(drive.voltage(force + law.force_for(state, black_box(1.0)), x));
    black_box((state.beyond_curve(), state.slope()));
}

#[cfg_attr(target_arch = "arm", cortex_m_rt::entry)]
#[cfg_attr(target_arch = "riscv32", riscv_rt::entry)]
fn main() -> ! {
    loop {
        step::<Compressed<f32>>();
        step::<Compressed<f32, 8, 14, 4>>();
        step::<Compressed<f32, 4, 11, 7>>();
        let (learning, learned) = (built::<Learning<f32>>(), built::<LearningState<f32>>());
        let sample = SensorSample { displacement_m: black_box(1e-3), age_ticks: black_box(10) };
        learned.observe(black_box(sample));
        black_box(learning.advance(learned, black_box(1e-3), black_box(Limited::NONE)));
        learning.restart(learned, black_box(1e-3), black_box(true));
        learned.forget();
        let (tracking, tracked) = (built::<Tracking<f32>>(), built::<TrackingState<f32>>());
        tracked.set_adapting(black_box(Adapting::Learn));
        tracked.forget();
        black_box(tracking.observe(tracked, Applied::as_commanded(black_box(1.0)), black_box(Some(sample))));
        black_box(tracking.command(tracked, black_box(1e-3)));
        black_box(tracked.adapted());
        let (sensing, sensed) = (built::<SelfSensing<f32>>(), built::<SelfSensingState<f32>>());
        sensing.correct(sensed, black_box(sample), black_box(1e-12));
        let reading =
            FilmReading { voltage_v: black_box(sensing.drive(sensed, black_box(1.0))), current_a: black_box(1e-6) };
        black_box(sensing.sense(sensed, reading).map(|sensed| sensed.uncertainty_m()));
        black_box((sensed.fault(), sensed.drive_v(), sensed.offset_m()));
        let adc_v = |code: u16| black_box(Some(AdcCode(code).volts(AdcRange::UpTo10V24)));
        let inputs = Inputs { interlock_closed: black_box(true), monitor_adc_v: adc_v(1), sensor_adc_v: adc_v(2) };
        black_box(built::<Device>().tick(inputs));
        black_box(built::<Device>().telemetry());
        if cfg!(feature = "can-panic") {
            black_box([1, 2, 3][black_box(3)]);
        }
    }
}
