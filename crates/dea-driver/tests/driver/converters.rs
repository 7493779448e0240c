//! The driver on models of its converters that know nothing of it: the ADS868x from its data sheet, the AD5754 from other drivers and from
//! memory. In virtual time, wired as in docs/boards.md.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use converter_chips::{Ad5754, Ads868x as AdcChip, Clock, Line, Rule, SpiBus, SpiTiming, SpiWire, Variant, Violation};
use dea_driver::chips::{AdcRange, CommandRange, Reference};
use dea_driver::{
    AdcError, Ads868x, Amplifier, AmplifierError, Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Mode,
};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::{MODE_0, MODE_1};

use crate::bench::{law_at, of_law};

const VARIANTS: [Variant; 3] = [Variant::Ads8681, Variant::Ads8685, Variant::Ads8689];

/// The board's buses: 5.25 MHz, and pull-downs on lines that no chip drives.
const BOARD: SpiTiming = SpiTiming {
    sck_hz: 5_250_000,
    between_bytes_ns: 200,
    lead_ns: 100,
    lag_ns: 100,
    between_transactions_ns: 300,
    slow_pad: false,
};

type Shared<C> = Rc<RefCell<C>>;

/// A perfect amplifier of 1000 V per volt between the converters, and a sensor at 1 V with some noise.
struct Bench<EN> {
    clock: Clock,
    dac: Shared<Ad5754>,
    monitor_chip: Shared<AdcChip>,
    sensor_chip: Shared<AdcChip>,
    amplifier: Amplifier<SpiWire, EN>,
    monitor: Ads868x<SpiWire>,
    sensor: Ads868x<SpiWire>,
    device: Device,
    enable: Rc<Cell<bool>>,
    period_ns: u64,
    ticks: u64,
    /// The largest output of the DAC while the amplifier was disabled, V.
    while_disabled_v: f64,
    /// Results of the last tick.
    applied: Result<(), AmplifierError>,
    read: Result<f32, AdcError>,
}

/// Parts of a bench, and how they are wired.
struct Parts {
    variant: Variant,
    rate_hz: f32,
    timing: SpiTiming,
    /// CLR is at the enable output, not at 3.3 V.
    clr_at_enable: bool,
    dac: Ad5754,
    reference: Reference,
    /// The level of the DAC's line, where no DAC is on it.
    absent: Option<bool>,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            variant: Variant::Ads8681,
            rate_hz: 1000.0,
            timing: BOARD,
            clr_at_enable: true,
            dac: Ad5754::new(),
            reference: Reference::External,
            absent: None,
        }
    }
}

/// A bench that has just been switched on.
fn bench(parts: Parts) -> Bench<impl OutputPin> {
    let Parts { variant, rate_hz, timing, clr_at_enable, dac, reference, absent } = parts;
    let clock = Clock::new();
    clock.advance(100_000_000);
    let (dac_bus, adc_bus) = (SpiBus::new(&clock, timing), SpiBus::new(&clock, timing));
    let dac = Rc::new(RefCell::new(dac));
    dac.borrow_mut().set_ldac(false, clock.now());
    dac.borrow_mut().set_clr(!clr_at_enable, clock.now());
    let enable = Rc::new(Cell::new(false));
    let pin = {
        let (dac, enable) = (Rc::clone(&dac), Rc::clone(&enable));
        Line::new(&clock, 50, move |level, now| {
            enable.set(level);
            if clr_at_enable {
                dac.borrow_mut().set_clr(level, now);
            }
        })
    };
    let film = {
        let (dac, enable) = (Rc::clone(&dac), Rc::clone(&enable));
        move |now| if enable.get() { dac.borrow().volts(now) } else { 0.0 }
    };
    let [monitor_chip, sensor_chip] = [(); 2].map(|()| Rc::new(RefCell::new(AdcChip::new(variant))));
    monitor_chip.borrow_mut().set_input_fn(film);
    sensor_chip.borrow_mut().set_input_fn(|now| 1.0 + 4e-4 * ((now / 1000) % 7) as f64);
    let wire = absent.map_or_else(|| dac_bus.connect(&dac, MODE_1), |level| dac_bus.absent(level));
    let amplifier = Amplifier::with_reference(wire, pin, CommandRange::FiveVolts, reference);
    let amplifier = amplifier.unwrap_or_else(|_| panic!("a bus"));
    let mut device = Device::new(None);
    device.install(Controller::new(Blob::new(of_law(&law_at(rate_hz.into()))).expect("valid"))).expect("disarmed");
    Bench {
        monitor: Ads868x::new(adc_bus.connect(&monitor_chip, MODE_0), AdcRange::UpTo10V24),
        sensor: Ads868x::new(adc_bus.connect(&sensor_chip, MODE_0), AdcRange::UpTo10V24),
        clock,
        dac,
        monitor_chip,
        sensor_chip,
        amplifier,
        device,
        enable,
        period_ns: (1e9 / rate_hz) as u64,
        ticks: 0,
        while_disabled_v: 0.0,
        applied: Ok(()),
        read: Err(AdcError::Starting),
    }
}

impl<EN: OutputPin> Bench<EN> {
    /// A tick as the firmware has it.
    fn tick(&mut self) {
        self.ticks += 1;
        self.clock.advance_to(200_000_000 + self.ticks * self.period_ns);
        self.read = self.monitor.volts();
        let inputs =
            Inputs { interlock_closed: true, monitor_adc_v: self.read.ok(), sensor_adc_v: self.sensor.volts().ok() };
        let drive: Drive = self.device.tick(inputs);
        self.applied = self.amplifier.apply(drive);
        if self.applied.is_err() {
            let _ = self.amplifier.disable();
            self.device.trip(Cause::Bus);
        }
        if !self.enable.get() {
            let volts = self.dac.borrow().volts(self.clock.now() + 20_000);
            self.while_disabled_v = self.while_disabled_v.max(volts.abs());
        }
        self.device.heartbeat();
    }

    fn ticks(&mut self, count: u32) {
        (0..count).for_each(|_| self.tick());
    }

    fn start(&mut self) {
        self.ticks(20);
        self.device.arm().expect("healthy");
        self.device.start(Mode::Voltage).expect("armed");
    }

    fn run_at_2_kv(&mut self) {
        self.start();
        self.device.set_voltage(2000.0).expect("within the limits");
        self.ticks(100);
    }

    /// It is acknowledged, and runs as before.
    fn comes_back(&mut self) {
        self.ticks(5);
        self.device.acknowledge().expect("tripped");
        self.run_at_2_kv();
        assert!((self.film_v() - 2000.0).abs() < 0.1 && self.state() == DriverState::Running, "{} V", self.film_v());
    }

    /// A tick before which the DAC was without its digital supply for a microsecond.
    fn tick_after_dip(&mut self) {
        let now = self.clock.now();
        self.dac.borrow_mut().set_dvcc(false, now);
        self.dac.borrow_mut().set_dvcc(true, now + 1000);
        self.tick();
    }

    /// A fault of the amplifier alone shows in the tick that would enable it.
    fn arming_trips(&mut self) {
        self.device.arm().expect("the readings are healthy");
        self.tick();
        assert_eq!((self.state(), self.enable.get()), (DriverState::Tripped(Cause::Bus), false));
    }

    fn state(&self) -> DriverState {
        self.device.state()
    }

    /// At the film, V.
    fn film_v(&self) -> f64 {
        if self.enable.get() { 1000.0 * self.dac.borrow().volts(self.clock.now() + 20_000) } else { 0.0 }
    }

    /// Rules of the data sheets that were broken, but for codes that are written on purpose where they do nothing: 0 V before
    /// power, and while CLR is low.
    fn broken(&self) -> Vec<Rule> {
        let of_dac = self.dac.borrow();
        let (monitor, sensor) = (self.monitor_chip.borrow(), self.sensor_chip.borrow());
        let all = of_dac.violations().iter().chain(monitor.violations()).chain(sensor.violations());
        all.map(|violation| violation.rule)
            .filter(|rule| !matches!(rule, Rule::WriteWhilePoweredDown | Rule::LoadWhileClear))
            .collect()
    }
}

/// A run from power-up to 3 kV and back, with every member of the ADC's family: no rule of the models is broken, the readings are the
/// present values, and the DAC shows 0 V as long as the amplifier is disabled, also on a bench whose CLR is at 3.3 V.
#[test]
fn a_run_breaks_no_rule_of_the_data_sheets() {
    for (variant, clr_at_enable) in VARIANTS.map(|variant| (variant, true)).into_iter().chain([(VARIANTS[0], false)]) {
        for rate_hz in [100.0, 1000.0, 5000.0] {
            let mut bench = bench(Parts { variant, rate_hz, clr_at_enable, ..Parts::default() });
            bench.start();
            bench.device.set_voltage(3000.0).expect("within the limits");
            bench.ticks((0.2 * rate_hz) as u32);
            assert_eq!(bench.state(), DriverState::Running, "{variant:?} at {rate_hz} Hz");
            assert!((bench.film_v() - 3000.0).abs() < 0.1, "{} V", bench.film_v());
            assert!((bench.read.expect("a reading") - 3.0).abs() < 2e-4);
            bench.device.stop().expect("running");
            bench.ticks(5);
            assert_eq!((bench.film_v(), bench.applied), (0.0, Ok(())));
            bench.device.disarm().expect("armed");
            bench.ticks(5);
            assert!(!bench.enable.get() && bench.while_disabled_v == 0.0, "{} V", bench.while_disabled_v);
            assert_eq!(bench.broken(), [], "{variant:?} at {rate_hz} Hz");
        }
    }
}

/// Up and down at the full slew through a perfect amplifier: the samples are a tick old, which is no disagreement, at any rate.
#[test]
fn a_ramp_at_full_slew_does_not_trip() {
    for rate_hz in [100.0, 200.0, 500.0, 1000.0, 5000.0] {
        let mut bench = bench(Parts { variant: Variant::Ads8689, rate_hz, ..Parts::default() });
        bench.start();
        for target_v in [6000.0, 0.0, 6000.0, 500.0] {
            bench.device.set_voltage(target_v).expect("within the limits");
            bench.ticks((0.3 * rate_hz) as u32);
            assert_eq!(bench.state(), DriverState::Running, "{rate_hz} Hz, towards {target_v} V");
            assert!((bench.film_v() - f64::from(target_v)).abs() < 0.1);
        }
    }
}

/// The erratum of slow pads: the last bit of a received byte is that of the byte before. Nothing is set up, so nothing is armed.
#[test]
fn a_last_bit_that_is_read_wrong_is_no_reading() {
    let mut bench = bench(Parts { timing: SpiTiming { slow_pad: true, ..BOARD }, ..Parts::default() });
    for _ in 0..50 {
        bench.tick();
        let fault = AdcError::Range { wanted: 9, found: 8 };
        assert_eq!(bench.read, Err(if bench.ticks < 4 { AdcError::Starting } else { fault }), "tick {}", bench.ticks);
    }
    assert!(bench.device.arm().is_err());
}

/// A dip of an ADC's supply puts it back on ±12.288 V, where 0 V reads as half of its codes. It shows in the first reading after it,
/// and the chip is set up again, in whatever state.
#[test]
fn an_adc_whose_supply_dips_shows_and_comes_back() {
    for runs in [false, true] {
        let mut bench = bench(Parts { variant: Variant::Ads8685, ..Parts::default() });
        if runs {
            bench.start();
            bench.device.set_voltage(1000.0).expect("within the limits");
        }
        bench.ticks(200);
        assert!(bench.read.is_ok());
        for (on, at_ns) in [(false, bench.clock.now()), (true, bench.clock.now() + 10_000)] {
            bench.monitor_chip.borrow_mut().set_dvdd(on, at_ns);
            bench.monitor_chip.borrow_mut().set_avdd(on, at_ns);
        }
        bench.tick();
        assert!(bench.read.is_err(), "{:?}", bench.read);
        assert_eq!(bench.state(), if runs { DriverState::Tripped(Cause::Bus) } else { DriverState::Disarmed });
        // 20 ms until it takes a frame, then four to set it up.
        bench.ticks(40);
        assert!(bench.read.expect("back").abs() < 1e-3, "{:?}", bench.read);
    }
}

/// No chip on the wire: it shows while the amplifier is disabled, and is not enabled by arming.
#[test]
fn a_missing_dac_shows_and_is_not_enabled() {
    for level in [false, true] {
        let mut bench = bench(Parts { absent: Some(level), ..Parts::default() });
        bench.ticks(20);
        assert!(matches!(bench.applied, Err(AmplifierError::Readback { wanted: 1, .. })), "{:?}", bench.applied);
        bench.arming_trips();
    }
}

/// Thermal shutdown and the current limit are on, and a chip that is too hot or at its limit is not enabled.
#[test]
fn a_dac_at_its_limits_is_not_enabled() {
    for hot in [true, false] {
        let mut bench = bench(Parts::default());
        bench.ticks(20);
        assert_eq!(bench.dac.borrow().control_bits() & 0xc, 0xc);
        let now = bench.clock.now();
        if hot {
            bench.dac.borrow_mut().set_over_temperature(true, now);
        } else {
            bench.dac.borrow_mut().set_over_current(true);
        }
        bench.tick();
        assert!(matches!(bench.applied, Err(AmplifierError::Readback { .. })), "{:?}", bench.applied);
        bench.arming_trips();
    }
}

/// An AD5754R on its own reference runs; an AD5754 that was taken for one is refused by its name before it is enabled. One that loses its digital
/// supply while it runs has forgotten its code: `Bus`, and the amplifier is disabled in the same tick. Back again, it is started anew.
#[test]
fn a_dac_on_its_own_reference_runs_and_one_without_is_refused() {
    for (dac, reference) in [
        (Ad5754::with_reference(false), Reference::Internal),
        (Ad5754::with_reference(true), Reference::External),
        (Ad5754::new(), Reference::External),
    ] {
        let mut bench = bench(Parts { dac, reference, ..Parts::default() });
        bench.run_at_2_kv();
        assert!((bench.film_v() - 2000.0).abs() < 0.1, "{reference:?}: {} V", bench.film_v());
        let two = |violation: &Violation| violation.rule == Rule::TwoReferences;
        assert!(!bench.dac.borrow().violations().iter().any(two), "two references drive one pin");
        // A dip of its supply switches the reference off as well.
        bench.tick_after_dip();
        assert_eq!((bench.state(), bench.enable.get()), (DriverState::Tripped(Cause::Bus), false), "{reference:?}");
        bench.comes_back();
    }
    let mut bench = bench(Parts { reference: Reference::Internal, ..Parts::default() });
    bench.ticks(20);
    assert_eq!(bench.applied, Err(AmplifierError::NoReference));
    bench.arming_trips();
}

/// Nothing that is read back shows that a reference is missing: the monitor does, and trips.
#[test]
fn a_dac_without_its_reference_trips_with_the_monitor() {
    let mut bench = bench(Parts { dac: Ad5754::with_reference(false), ..Parts::default() });
    bench.run_at_2_kv();
    assert_eq!(bench.state(), DriverState::Tripped(Cause::Monitor));
}
