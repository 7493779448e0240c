//! The boards, as the tests of every board see them.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::board::Board;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::f4::{stm32_h405, stm32f407_discovery};
use board_on_host::hal::rcc::Config;
use converter_chips::{Ad5754, Ads868x, Rule, Variant};
use dea_driver::chips::{Calibration, CommandRange, Converters};
use dea_driver::wire::Inspection;
use dea_driver::{AmplifierError, Drive, Inputs};

use super::slaves::{adc_wiring, dac_wiring};
use super::start::{crystal, start_discovery, start_on};

/// Ticks after which every converter is set up.
pub const SET_UP: usize = 8;

/// A board's bench, as the application uses it.
pub trait Ticks {
    fn sample(&mut self) -> Inputs;
    fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError>;
    fn inspection(&self) -> Inspection;
}

macro_rules! ticks {
    ($($bench:ty),*) => {$(
        impl Ticks for $bench {
            fn sample(&mut self) -> Inputs {
                self.sample()
            }

            fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
                self.apply(drive)
            }

            fn inspection(&self) -> Inspection {
                self.inspection()
            }
        }
    )*};
}
ticks!(stm32_h405::Bench, stm32f407_discovery::Bench);

/// A board and what is connected to it.
pub trait Kind: Sized {
    type Bench: Ticks;
    const NAME: &'static str;
    const ID: u16;
    const CONVERTERS: Converters;
    const ENABLE: Pin;
    const INTERLOCK: Pin;
    /// A command in the middle of the range.
    const ON: Drive;
    const OFF: Drive = Drive { enable: false, dac_v: 0.0, ..Self::ON };
    /// How far a reading and the output may be off, V.
    const STEP_V: f64;
    /// Volts at the DAC's output for one that is commanded: what loads it.
    const LOADED: f64;
    /// Amplifier and monitor of 1000 V per volt of a usual bench, and a sensor of 1 mm/V, at the pins of this board.
    const GAIN: f32;
    const SENSOR: Calibration;
    /// Connects converters and instruments to a board that has just been switched on.
    fn on(board: &Board) -> Self;
    /// Starts the firmware, up to the bench and the link.
    fn start(board: &Board, clocks: Config) -> Self::Bench;
    fn set_monitor(&self, board: &Board, volts: f64);
    fn set_sensor(&self, board: &Board, volts: f64);
    /// The command at the DAC's output, V.
    fn command_v(&self, board: &Board) -> f64;
    /// The DAC fails, as its kind does.
    fn fail_dac(&self, board: &Board);
    /// The ADC of the monitor fails, as its kind does, or is back.
    fn fail_monitor(&self, board: &Board, fails: bool);
    /// Nothing was done that the documents of chip and converters forbid.
    fn assert_no_violations(&self, board: &Board);
}

/// A tick, a thousand times a second.
pub fn tick<B: Ticks>(board: &Board, bench: &mut B, drive: Drive) -> (Inputs, Result<(), AmplifierError>) {
    let start = board.chip(|chip| chip.now_ns());
    let inputs = bench.sample();
    let applied = bench.apply(drive);
    board.chip(|chip| chip.wait_ns(1_000_000 - (chip.now_ns() - start)));
    (inputs, applied)
}

/// Asserts that a reading is as wanted.
pub fn assert_near<K: Kind>(found: Option<f32>, wanted: f64) {
    let near = |found: f32| (f64::from(found) - wanted).abs() <= K::STEP_V;
    assert!(found.is_some_and(near), "{}: {found:?} instead of {wanted} V", K::NAME);
}

/// A board with its converters and instruments.
pub fn board_of<K: Kind>() -> (Board, K) {
    let board = Board::new(Oscillators::default());
    let wired = K::on(&board);
    (board, wired)
}

/// The STM32F405 with the converters of `docs/wiring.md`.
pub struct H405 {
    pub dac: Rc<RefCell<Ad5754>>,
    pub monitor: Rc<RefCell<Ads868x>>,
    pub sensor: Rc<RefCell<Ads868x>>,
}

impl H405 {
    /// Wires them to a board: straight binary, LDAC to ground, CLR to the enable output; RST high.
    pub fn with(board: &Board, variant: Variant) -> Self {
        let dac = Rc::new(RefCell::new(Ad5754::new()));
        dac.borrow_mut().set_ldac(false, 0);
        let [monitor, sensor] = [(); 2].map(|()| Rc::new(RefCell::new(Ads868x::new(variant))));
        let cleared = Rc::clone(&dac);
        board.chip(|chip| {
            // They had power long before the chip has.
            chip.wait_ns(50_000_000);
            chip.watch(Self::ENABLE, move |high, now| cleared.borrow_mut().set_clr(high, now));
            chip.wire(dac_wiring(), dac.clone());
            chip.wire(adc_wiring(0), monitor.clone());
            chip.wire(adc_wiring(1), sensor.clone());
        });
        Self { dac, monitor, sensor }
    }
}

impl Kind for H405 {
    type Bench = stm32_h405::Bench;
    const NAME: &'static str = "STM32-H405";
    const ID: u16 = stm32_h405::ID;
    const CONVERTERS: Converters = stm32_h405::CONVERTERS;
    const ENABLE: Pin = Pin::new('C', 6);
    const INTERLOCK: Pin = Pin::new('C', 7);
    const ON: Drive = Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts };
    const STEP_V: f64 = 10.24 / 65536.0;
    const LOADED: f64 = 1.0;
    const GAIN: f32 = 1000.0;
    const SENSOR: Calibration = Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 };

    fn on(board: &Board) -> Self {
        Self::with(board, Variant::Ads8689)
    }

    fn start(board: &Board, clocks: Config) -> Self::Bench {
        start_on(board, clocks)
    }

    fn set_monitor(&self, _: &Board, volts: f64) {
        self.monitor.borrow_mut().set_input(volts);
    }

    fn set_sensor(&self, _: &Board, volts: f64) {
        self.sensor.borrow_mut().set_input(volts);
    }

    fn command_v(&self, board: &Board) -> f64 {
        self.dac.borrow().volts(board.chip(|chip| chip.now_ns()))
    }

    fn fail_dac(&self, board: &Board) {
        let now = board.chip(|chip| chip.now_ns());
        self.dac.borrow_mut().set_dvcc(false, now);
    }

    fn fail_monitor(&self, board: &Board, fails: bool) {
        let now = board.chip(|chip| chip.now_ns());
        self.monitor.borrow_mut().set_dvdd(!fails, now);
    }

    /// 0 V is written to a DAC that is cleared, or has no power yet, on purpose: it is at 0 V already, and takes no code.
    fn assert_no_violations(&self, board: &Board) {
        assert_eq!(board.violations(), []);
        let at_zero = |rule| matches!(rule, Rule::WriteWhilePoweredDown | Rule::LoadWhileClear);
        let dac = self.dac.borrow();
        let found: Vec<_> = dac.violations().iter().filter(|violation| !at_zero(violation.rule)).collect();
        assert!(found.is_empty(), "{found:?}");
        assert_eq!(self.monitor.borrow().violations(), []);
        assert_eq!(self.sensor.borrow().violations(), []);
    }
}

/// ST's STM32F4DISCOVERY with the converters on its chip, as `docs/boards.md` has it.
pub struct Discovery;

impl Discovery {
    pub const DAC: Pin = Pin::new('A', 5);
    pub const MONITOR: Pin = Pin::new('B', 0);
    pub const SENSOR_PIN: Pin = Pin::new('B', 1);
}

impl Kind for Discovery {
    type Bench = stm32f407_discovery::Bench;
    const NAME: &'static str = "STM32F4DISCOVERY";
    const ID: u16 = stm32f407_discovery::ID;
    const CONVERTERS: Converters = stm32f407_discovery::CONVERTERS;
    const ENABLE: Pin = Pin::new('C', 6);
    const INTERLOCK: Pin = Pin::new('C', 8);
    const ON: Drive = Drive { enable: true, dac_v: 1.5, range: CommandRange::TenVolts };
    // Half a code, and half of one of the chip's reference, which has 1652 at 3 V.
    const STEP_V: f64 = 0.5 * 3.0 / 4096.0 + 3.0 * 0.5 / 1652.0;
    const LOADED: f64 = 1500.0 / 1515.0;
    // 24 and 10 kΩ: an operational amplifier of 3.4 behind the DAC, and dividers by as much before the ADCs.
    const GAIN: f32 = 3400.0;
    const SENSOR: Calibration = Calibration::Parabola { offset: -1e-3, gain: 3.4e-3, quadratic: 0.0 };

    fn on(board: &Board) -> Self {
        Self.set_monitor(board, 0.0);
        Self.set_sensor(board, 0.3);
        Self
    }

    fn start(board: &Board, clocks: Config) -> Self::Bench {
        start_discovery(board, clocks)
    }

    fn set_monitor(&self, board: &Board, volts: f64) {
        board.chip(|chip| chip.put(Self::MONITOR, volts));
    }

    fn set_sensor(&self, board: &Board, volts: f64) {
        board.chip(|chip| chip.put(Self::SENSOR_PIN, volts));
    }

    fn command_v(&self, board: &Board) -> f64 {
        board.chip(|chip| chip.volts(Self::DAC))
    }

    fn fail_dac(&self, board: &Board) {
        board.chip(|chip| chip.around.shorted = Some((Self::DAC, 3.0)));
    }

    fn fail_monitor(&self, board: &Board, fails: bool) {
        board.chip(|chip| chip.adcs[0].is_dead = fails);
    }

    fn assert_no_violations(&self, board: &Board) {
        assert_eq!(board.violations(), [], "{}", Self::NAME);
    }
}

/// The clocks of the core.
pub fn clocks() -> [Config; 2] {
    [crystal(), Config::hsi()]
}
