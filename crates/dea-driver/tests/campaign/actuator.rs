//! Faults on the other side of [`Drive`]: DAC stuck at a code, DAC on the other range, enable welded or dead, converters whose supply has
//! dipped or whose bus fails; each in every state of the driver, while a host goes on and tries again.
//!
//! Pass, by the voltage at the film and not by what the driver knows:
//!
//! - while the amplifier is enabled the film is not astray (60 V + 3 % from the command) for more than 22 ticks in one piece; longer ends
//!   in a trip, and [`Status`] names its cause;
//! - while it is disabled the film is at 0 V (60 V) after a second and two ticks, or `Status` shows `LiveFilm` and that the film is live;
//! - a monitor that is silent or beyond its range trips what is armed or running within two ticks, one that shows another voltage than
//!   the command within 22, a sensor out of range within two; while one of them is out of range or silent nothing can be armed;
//! - at the end the film is at 0 V, or `LiveFilm` is shown.
//!
//! Nothing can notice, since the film does as it should: an enable output that is welded while the DAC obeys (the film is at 0 V when
//! disabled); one that is dead, a DAC at 0 V or on another range, a monitor that shows 0 V, until more than the band is commanded.
//!
//! 168 runs of 7.5 s in the sample, 10 080 in full: every fault in every state equally often.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use dea_driver::chips::{Calibration, CommandRange, DacCode};
use dea_driver::server::Denial;
use dea_driver::wire::Status;
use dea_driver::{Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Mode};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

use crate::bench::changed_parameters;
use crate::circuit::converted;
use crate::film::{Film, ModelFilm};
use crate::scale::cases;

/// Longest time astray while enabled, and with voltage while disabled, ticks of a millisecond: the settling time, and one each to
/// sample, to notice, and in which a reading may be a tick old.
const ASTRAY: u32 = 23;
const LIVE: u32 = 1002;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Adc {
    Zero,
    Full,
    /// Back on ±12.288 V after its supply has dipped: asked for its range while idle, it does not read.
    OtherRange,
    Silent,
}

const ADCS: [Adc; 4] = [Adc::Zero, Adc::Full, Adc::OtherRange, Adc::Silent];

impl Adc {
    /// Volts, of `volts` at the input.
    fn reads(self, volts: f64, idle: bool) -> Option<f64> {
        match self {
            Self::Zero => Some(0.0),
            Self::Full => Some(10.24),
            Self::OtherRange if idle => None,
            Self::OtherRange => Some((volts / 24.576 + 0.5) * 10.24),
            Self::Silent => None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fault {
    DacStuck(u16),
    /// 5 V in place of 10 V; 10 V in place of 5 V.
    OtherRange,
    EnableWelded,
    EnableDead,
    /// Two faults, of which the first alone does nothing.
    WeldedAndStuck(u16),
    /// It does not hold what it was sent.
    DacSilent,
    Monitor(Adc),
    Sensor(Adc),
}

impl Fault {
    fn name(self) -> String {
        match self {
            Self::DacStuck(0) => "DAC stuck at 0".into(),
            Self::DacStuck(_) => "DAC stuck".into(),
            Self::WeldedAndStuck(_) => "enable welded, DAC stuck".into(),
            other => format!("{other:?}"),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum State {
    Disarmed,
    Armed,
    Running(u8),
    Tripped,
}

const STATES: [State; 6] =
    [State::Disarmed, State::Armed, State::Running(0), State::Running(1), State::Running(2), State::Tripped];
const MODES: [Mode; 3] = [Mode::Voltage, Mode::Feedforward, Mode::Tracking];
const FAULTS: u64 = 14;

#[derive(Clone, Debug)]
struct Case {
    number: u64,
    fault: Fault,
    state: State,
    range: CommandRange,
    /// Mean of the commands that move: V in mode voltage, m otherwise.
    mean: f64,
    amplitude: f64,
    frequency_hz: f64,
    /// Tick of the fault.
    begins: u32,
}

impl Case {
    fn new(number: u64) -> Self {
        let random = &mut Pcg64::seed_from_u64(number);
        // 200 to 9900 V.
        let code = random.random_range(1300..64_900u16);
        let fault = match number % FAULTS {
            0 => Fault::DacStuck(0),
            1 => Fault::DacStuck(code),
            2 => Fault::OtherRange,
            3 => Fault::EnableWelded,
            4 => Fault::EnableDead,
            5 => Fault::WeldedAndStuck(code),
            kind @ 6..10 => Fault::Monitor(ADCS[kind as usize - 6]),
            // In place of a fourteenth for one ADC.
            kind @ 10..13 => Fault::Sensor(ADCS[kind as usize - 10]),
            _ if random.random_bool(0.5) => Fault::Sensor(Adc::Silent),
            _ => Fault::DacSilent,
        };
        let state = STATES[(number / FAULTS) as usize % STATES.len()];
        let range = if random.random_bool(0.5) { CommandRange::FiveVolts } else { CommandRange::TenVolts };
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let (low, high) = if state == State::Running(0) { (800.0, 3500.0) } else { (0.2e-3, 1.2e-3) };
        let (mean, amplitude) = (between(low, high), between(0.1, 0.4));
        let frequency_hz = between(0.1, 0.5);
        Self { number, fault, state, range, mean, amplitude, frequency_hz, begins: between(1000.0, 3000.0) as u32 }
    }

    fn wanted(&self, tick: u32) -> f32 {
        let sine = (TAU * self.frequency_hz * f64::from(tick) / 1000.0).sin();
        (self.mean * (1.0 + self.amplitude * sine)) as f32
    }
}

/// A board with its bench, as the firmware runs it.
struct Board {
    device: Device,
    film: Film,
    /// High voltage per volt of the command.
    gain: f64,
    film_v: f64,
    displacement_m: f64,
    random: Pcg64,
    /// Why it was not armed again.
    refused: Option<Denial>,
}

impl Board {
    fn new(case: &Case) -> Self {
        // 10 kV at the end of either range.
        let gain = 10e3 / f64::from(case.range.full_scale_v());
        let parameters =
            changed_parameters(|p| (p.command_range, p.amplifier) = (case.range, Calibration::linear(gain as f32)));
        let mut device = Device::new(None);
        device.install(Controller::new(Blob::new(parameters).expect("valid"))).expect("disabled");
        let (film, random) = (Film::Model(ModelFilm::new(1.0, 1.0)), Pcg64::seed_from_u64(!case.number));
        Self { device, film, gain, film_v: 0.0, displacement_m: 0.0, random, refused: None }
    }

    fn noisy(&mut self, volts: f64) -> f32 {
        converted(volts, StandardNormal.sample(&mut self.random))
    }

    fn tick(&mut self, fault: Option<Fault>) {
        let idle = !self.device.state().is_live();
        let (monitor_v, sensor_v) = (self.film_v / 1000.0, 1.0 + self.displacement_m / 1e-3);
        let monitor = match fault {
            Some(Fault::Monitor(adc)) => adc.reads(monitor_v, idle),
            _ => Some(monitor_v),
        };
        let sensor = match fault {
            Some(Fault::Sensor(adc)) => adc.reads(sensor_v, idle),
            _ => Some(sensor_v),
        };
        let monitor_adc_v = monitor.map(|volts| self.noisy(volts));
        let sensor_adc_v = sensor.map(|volts| self.noisy(volts));
        let drive = self.device.tick(Inputs { interlock_closed: true, monitor_adc_v, sensor_adc_v });
        let enabled = match fault {
            Some(Fault::DacSilent) if drive.enable => {
                // The amplifier's driver has disabled it, and the firmware says so.
                self.device.trip(Cause::Bus);
                false
            }
            Some(Fault::EnableWelded | Fault::WeldedAndStuck(_)) => true,
            Some(Fault::EnableDead) => false,
            _ => drive.enable,
        };
        let command_v = Self::dac_v(drive, fault) * self.gain;
        // 600 pF through 100 MΩ.
        self.film_v = if enabled { command_v } else { self.film_v * (-1.0f64 / 60.0).exp() };
        self.displacement_m = self.film.step(self.film_v);
    }

    fn dac_v(drive: Drive, fault: Option<Fault>) -> f64 {
        let other = match drive.range {
            CommandRange::FiveVolts => CommandRange::TenVolts,
            CommandRange::TenVolts => CommandRange::FiveVolts,
        };
        // The firmware brings it to 0 V while the amplifier is disabled.
        let volts = if drive.enable { drive.dac_v } else { 0.0 };
        let code = DacCode::from_volts(volts, drive.range);
        f64::from(match fault {
            Some(Fault::DacStuck(code) | Fault::WeldedAndStuck(code)) => DacCode(code).volts(drive.range),
            Some(Fault::OtherRange) => code.volts(other),
            _ => code.volts(drive.range),
        })
    }

    /// Does the work of a host in `tick`; errors are the board's refusals.
    fn host(&mut self, case: &Case, tick: u32) {
        let device = &mut self.device;
        let mode = if let State::Running(mode) = case.state { MODES[usize::from(mode)] } else { Mode::Voltage };
        let after = tick.saturating_sub(case.begins);
        let wanted = case.wanted(tick);
        let again = after == 3000;
        if tick == 10 || again {
            let _ = device.acknowledge();
            if again {
                self.refused = device.arm().err();
            } else if case.state != State::Disarmed {
                device.arm().expect("healthy");
            }
        }
        if tick == 20 {
            match case.state {
                State::Running(_) => device.start(mode).expect("armed"),
                State::Tripped => device.trip(Cause::Overrun),
                _ => {}
            }
        }
        if after == 3020 {
            let _ = device.start(mode);
        }
        if after == 1500 || after == 5000 {
            let _ = device.disarm();
        }
        let moves = matches!(case.state, State::Running(_)) || after > 3020;
        if moves && device.state() == DriverState::Running && tick.is_multiple_of(10) {
            let wanted = if matches!(case.state, State::Running(_)) { wanted } else { 1000.0 + 0.5e6 * wanted };
            let set = if mode == Mode::Voltage { device.set_voltage(wanted) } else { device.set_reference(wanted) };
            set.expect("within the limits");
        }
        device.heartbeat();
    }
}

/// Behaviour of the film, and the driver's reports.
#[derive(Default)]
struct Watch {
    /// Ticks in a row.
    astray: u32,
    live: u32,
    misread: u32,
    first: Option<Cause>,
    largest_astray: u32,
    largest_live: u32,
}

impl Watch {
    fn tick(&mut self, case: &Case, fault: Option<Fault>, film_v: f64, status: Status) {
        let about = || format!("{status:?}, film at {film_v} V, {case:?}");
        if let DriverState::Tripped(cause) = status.state
            && fault.is_some()
            && !(case.state == State::Tripped && cause == Cause::Overrun)
        {
            self.first.get_or_insert(cause);
        }
        let enabled = status.state.is_live();
        let command_v = f64::from(status.command_v);
        let astray = enabled && (film_v - command_v).abs() > 60.0 + 0.03 * command_v;
        self.astray = if astray { self.astray + 1 } else { 0 };
        self.largest_astray = self.largest_astray.max(self.astray);
        assert!(self.astray <= ASTRAY, "astray: {}", about());
        let reported = status.state == DriverState::Tripped(Cause::LiveFilm) && status.live;
        let live = !enabled && film_v > 61.0 && !reported;
        self.live = if live { self.live + 1 } else { 0 };
        self.largest_live = self.largest_live.max(self.live);
        assert!(self.live <= LIVE, "live: {}", about());
        // Converters that lie or do not answer.
        let most = match fault {
            Some(Fault::Monitor(Adc::Silent | Adc::Full) | Fault::Sensor(_) | Fault::DacSilent) => 1,
            Some(Fault::Monitor(Adc::OtherRange)) => ASTRAY,
            Some(Fault::Monitor(Adc::Zero)) if command_v > 65.0 => ASTRAY,
            _ => u32::MAX,
        };
        self.misread = if enabled && most < u32::MAX { self.misread + 1 } else { 0 };
        assert!(self.misread <= most, "misread for {} ticks: {}", self.misread, about());
    }
}

/// How a run ended: by the first cause, or because it could not be armed.
fn run(number: u64) -> (Case, Watch, Option<String>) {
    let case = Case::new(number);
    let mut board = Board::new(&case);
    let mut watch = Watch::default();
    for tick in 0..case.begins + 6500 {
        board.host(&case, tick);
        let fault = (tick >= case.begins).then_some(case.fault);
        if tick == case.begins {
            let expected = match case.state {
                State::Disarmed => DriverState::Disarmed,
                State::Armed => DriverState::Armed,
                State::Running(_) => DriverState::Running,
                State::Tripped => DriverState::Tripped(Cause::Overrun),
            };
            assert_eq!(board.device.state(), expected, "before the fault: {case:?}");
        }
        board.tick(fault);
        watch.tick(&case, fault, board.film_v, board.device.status());
    }
    let status = board.device.status();
    let reported = status.state == DriverState::Tripped(Cause::LiveFilm) && status.live;
    assert!(board.film_v <= 61.0 || reported, "at the end at {} V: {status:?}, {case:?}", board.film_v);
    assert!(!status.state.is_live());
    let shows_before_arming =
        matches!(case.fault, Fault::Monitor(Adc::Silent | Adc::Full | Adc::OtherRange) | Fault::Sensor(_));
    assert!(!shows_before_arming || board.refused.is_some(), "armed: {case:?}");
    let refused = board.refused.map(|denial| format!("not armed: {denial:?}"));
    let end = watch.first.map(|cause| format!("{cause:?}")).or(refused);
    (case, watch, end)
}

#[test]
fn no_fault_of_an_actuator_keeps_a_film_astray() {
    let number = cases(2, 120) * FAULTS * STATES.len() as u64;
    let mut counts: BTreeMap<(String, State), BTreeMap<String, u32>> = BTreeMap::new();
    let (mut astray, mut live) = (0, 0);
    for number in 0..number {
        let (case, watch, end) = run(number);
        assert!(end.is_some() || case.fault == Fault::EnableWelded, "not noticed: {case:?}");
        let end = end.unwrap_or("nothing to notice".into());
        *counts.entry((case.fault.name(), case.state)).or_default().entry(end).or_default() += 1;
        (astray, live) = (watch.largest_astray.max(astray), watch.largest_live.max(live));
        // Every fault that moves the film away from the command is reported.
        assert!(watch.largest_astray < ASTRAY - 1 || watch.first.is_some(), "{case:?}");
    }
    println!("actuator: {number} runs; astray for {astray} ms at the most, live without a report for {live} ms");
    for ((fault, state), ends) in counts {
        println!("  {fault}, {state:?}: {ends:?}");
    }
}
