//! The film as its own sensor on every board: the firmware's simulated film at the pins, with the tone on.

use board_on_host::film::Film;
use dea_driver::chips::Calibration;
use dea_driver::{Cause, Control, Drive, DriverState, Mode, OnSensorFault, Parameters, SelfSensor};
use springpot::{Actuator, CapacitanceRelation, SelfSensingOptions};

use super::current::peak;
use super::kinds::{H405, Kind, is_enabled, on_every_board};
use super::promises::{Row, Running, parameters, rows};

/// The current that the monitor shows at its ends, A: that of the peaks.
const RANGE_A: f64 = 0.5e-3;
/// A tick, ns.
const TICK_NS: f64 = 1e6;

/// Ticks by which a sensor that rests may be frozen longer than without the tone: its samples come slower.
const LATER: u32 = 100;

/// The output of the monitor of the current without one, V.
fn middle_v<K: Kind>() -> f64 {
    f64::from(K::CURRENT_V.min(3.0)) / 2.0
}

/// Parameters with self-sensing.
fn sensed_parameters<K: Kind>() -> Parameters {
    let mut parameters = parameters::<K>();
    let gain = RANGE_A / (f64::from(K::CURRENT_V) - middle_v::<K>());
    let offset = -gain * middle_v::<K>();
    let current = Calibration::Parabola { offset: offset as f32, gain: gain as f32, quadratic: 0.0 };
    let rest_f = 700e-12;
    let relation = CapacitanceRelation::of_geometry(rest_f, Actuator::KARNER_2022.length_m, 2.0, 1.2 * rest_f);
    let sensor = SelfSensor::new(&relation, SelfSensingOptions::BENCH, current).expect("valid");
    parameters.limits.max_slew_v_per_s = 100e3;
    parameters.limits.sensor.stuck_ticks += LATER;
    parameters.control = Control {
        max_velocity_m_per_s: 0.015,
        sample_interval_s: 0.02,
        delay_s: 0.014,
        lost_after_s: 0.2,
        ..parameters.control
    };
    Parameters { self_sensing: Some(sensor), ..parameters }
}

impl<K: Kind> Running<K> {
    /// A film at 0.5 mm, with the tone on.
    fn tracking(parameters: &Parameters, sensor_v: Option<f64>) -> Self {
        let mut running = Self::with(parameters);
        running.film = Film::from_controller(running.device.controller().expect("installed"));
        running.sensor_v = sensor_v;
        (0..20).for_each(|_| running.tick());
        running.device.arm().expect("healthy");
        running.device.start(Mode::Tracking).expect("armed");
        running.follow(|tick| 0.5e-3 * f64::from(tick.min(200)) / 200.0, 300);
        running
    }

    /// Ticks along a reference (m).
    fn follow(&mut self, reference_m: impl Fn(u32) -> f64, ticks: u32) {
        for tick in 0..ticks {
            self.device.set_reference(reference_m(tick) as f32).expect("within the limits");
            self.tick();
            assert_eq!(self.device.state(), DriverState::Running, "{}, tick {tick}", K::NAME);
        }
    }

    /// The film under the amplifier's output, to the end of the tick: the outputs of voltage monitor and sensor then, V.
    pub fn advance_film(&mut self) -> Option<[f64; 2]> {
        let film = self.film.as_mut()?;
        // The output of the DAC settles.
        let now = self.board.chip(|chip| {
            chip.wait_ns(20_000);
            chip.now_ns()
        });
        let command_v = self.kind.command_v(&self.board) as f32;
        film.advance(Drive { enable: is_enabled::<K>(&self.board), dac_v: command_v, ..K::ON });
        let (middle_v, shown_v) = (middle_v::<K>(), self.current_v);
        let charge = (f64::from(film.current_v()) - middle_v) * TICK_NS;
        let volts = move |at: u64| shown_v.unwrap_or(middle_v + charge * peak((at - now) as f64));
        self.board.chip(|chip| chip.around.course = Some((K::CURRENT, Box::new(volts))));
        Some([f64::from(film.monitor_v()), f64::from(film.sensor_v())])
    }
}

/// Faults of the current, which are found within three blocks.
fn of_current<K: Kind>() -> [Row<K>; 3] {
    const LOST: &[Cause] = &[Cause::CurrentMonitor, Cause::NoTone];
    [
        ("converter of the current fails", |running| running.board.chip(|chip| chip.adcs[2].is_dead = true), LOST, 80),
        ("monitor of the current breaks", |running| running.current_v = Some(0.0), LOST, 80),
        ("monitor of the current stays", |running| running.current_v = Some(middle_v::<K>()), LOST, 80),
    ]
}

fn every_fault_ends_at_0_v_with_the_tone_on<K: Kind>() {
    for (name, spoil, causes, latest) in rows::<K>().into_iter().chain(of_current()) {
        let mut running = Running::<K>::tracking(&sensed_parameters::<K>(), None);
        running.kind.assert_no_violations(&running.board);
        spoil(&mut running);
        let (ticks, cause) = running.trips();
        let latest = if name.starts_with("sensor at") { latest + LATER } else { latest };
        assert!(causes.contains(&cause), "{}, {name}: {cause:?}", K::NAME);
        assert!(ticks <= latest, "{}, {name}: only after {ticks} ticks", K::NAME);
    }
}

/// Without its displacement sensor. An error of 0.1 % of the current would be one of 20 µm.
#[test]
fn a_film_is_tracked_by_its_own_capacitance_at_the_pins() {
    let mut parameters = sensed_parameters::<H405>();
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    let mut running = Running::<H405>::tracking(&parameters, Some(0.0));
    running.board.chip(|chip| chip.around.noise = 1);
    running.follow(|_| 0.5e-3, 1500);
    let shown_m = running.film.as_ref().map_or(0.0, |film| H405::SENSOR.apply(film.sensor_v()));
    println!("{:.1} um", 1e6 * (shown_m - 0.5e-3));
    assert!((shown_m - 0.5e-3).abs() < 30e-6, "{shown_m} m");
}

on_every_board!(every_fault_ends_at_0_v_with_the_tone_on);
