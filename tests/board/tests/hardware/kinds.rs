//! The boards, as the tests of every board see them.

use std::cell::RefCell;
use std::rc::Rc;

use board_on_host::board::Board;
use board_on_host::chip::family::Family;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::f4::{stm32_h405, stm32f407_discovery};
use board_on_host::g4::nucleo_g474re;
use converter_chips::{Ad5754, Ads868x, Rule, Variant};
use dea_driver::chips::{Calibration, CommandRange, Converters};
use dea_driver::wire::Inspection;
use dea_driver::{AmplifierError, Drive, Inputs};

use super::slaves::{adc_wiring, dac_wiring};
use super::start::{Core, start_discovery, start_h405, start_nucleo};

/// Ticks after which every converter is set up.
pub const SET_UP: usize = 8;

/// A board's bench, as the application uses it.
pub trait Ticks {
    fn sample(&mut self) -> Inputs;
    fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError>;
    fn inspection(&self) -> Inspection;
    #[cfg(feature = "self-sensing")]
    fn current_adc_v(&mut self, rate_hz: f32) -> Option<f32>;
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

            #[cfg(feature = "self-sensing")]
            fn current_adc_v(&mut self, rate_hz: f32) -> Option<f32> {
                self.current_adc_v(rate_hz)
            }
        }
    )*};
}
ticks!(stm32_h405::Bench, stm32f407_discovery::Bench, nucleo_g474re::Bench);

/// A board and what is connected to it.
pub trait Kind: Sized {
    type Bench: Ticks;
    const NAME: &'static str;
    const FAMILY: Family = Family::F4;
    const CRYSTAL_HZ: u32;
    const ID: u16;
    const CONVERTERS: Converters;
    const ENABLE: Pin;
    const INTERLOCK: Pin;
    /// The monitor of the current, with the feature, and its largest output, V.
    const CURRENT: Pin = Pin::new('C', 1);
    #[cfg(feature = "self-sensing")]
    const CURRENT_V: f32;
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
    fn start(board: &Board, core: Core) -> Self::Bench;
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
    #[cfg(feature = "self-sensing")]
    bench.current_adc_v(1000.0);
    let applied = bench.apply(drive);
    board.chip(|chip| chip.wait_ns(1_000_000 - (chip.now_ns() - start)));
    (inputs, applied)
}

/// Ticks with these drives, each of which is applied.
pub fn run<K: Kind>(board: &Board, bench: &mut K::Bench, drives: impl IntoIterator<Item = Drive>) {
    for drive in drives {
        assert_eq!(tick(board, bench, drive).1, Ok(()), "{}", K::NAME);
    }
}

pub fn is_enabled<K: Kind>(board: &Board) -> bool {
    board.chip(|chip| chip.level(K::ENABLE))
}

/// Asserts that a reading is as wanted.
pub fn assert_near<K: Kind>(found: Option<f32>, wanted: f64) {
    let near = |found: f32| (f64::from(found) - wanted).abs() <= K::STEP_V;
    assert!(found.is_some_and(near), "{}: {found:?} instead of {wanted} V", K::NAME);
}

/// A test of each name, which calls the function of that name for every board.
macro_rules! on_every_board {
    ($($test:ident),*) => {
        mod on_every_board {
            use crate::kinds::{Discovery, H405, Nucleo};

            $(#[test]
            fn $test() {
                super::$test::<H405>();
                super::$test::<Discovery>();
                super::$test::<Nucleo>();
            })*
        }
    };
}
pub(crate) use on_every_board;

/// The same for the boards with converters on their chip.
macro_rules! on_chip_boards {
    ($($test:ident),*) => {
        mod on_chip_boards {
            use crate::kinds::{Discovery, Nucleo};

            $(#[test]
            fn $test() {
                super::$test::<Discovery>();
                super::$test::<Nucleo>();
            })*
        }
    };
}
pub(crate) use on_chip_boards;

/// A board with its converters and instruments.
pub fn board_of<K: Kind>() -> (Board, K) {
    let crystal_hz = Some(K::CRYSTAL_HZ);
    let board = Board::with(K::FAMILY, Oscillators { crystal_hz, ..Oscillators::default() });
    let wired = K::on(&board);
    (board, wired)
}

/// The STM32F405 with its converters, as in `docs/boards.md`.
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
            chip.around.supply_v = 3.3;
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
    const CRYSTAL_HZ: u32 = stm32_h405::CRYSTAL_HZ;
    const ID: u16 = stm32_h405::ID;
    const CONVERTERS: Converters = stm32_h405::CONVERTERS;
    const ENABLE: Pin = Pin::new('C', 6);
    const INTERLOCK: Pin = Pin::new('C', 7);
    #[cfg(feature = "self-sensing")]
    const CURRENT_V: f32 = stm32_h405::CURRENT_V;
    const ON: Drive = Drive { enable: true, dac_v: 3.0, range: CommandRange::TenVolts };
    const STEP_V: f64 = 10.24 / 65536.0;
    const LOADED: f64 = 1.0;
    const GAIN: f32 = 1000.0;
    const SENSOR: Calibration = Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 };

    fn on(board: &Board) -> Self {
        Self::with(board, Variant::Ads8689)
    }

    fn start(board: &Board, core: Core) -> Self::Bench {
        start_h405(board, core)
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

/// A board with the converters on its chip, as `docs/boards.md` has it.
pub trait OnChip: Kind + Default {
    const DAC: Pin;
    const MONITOR: Pin;
    const SENSOR_PIN: Pin;
    /// Its supply in the middle of the range.
    const SUPPLY_V: f64;
    const CYCLES_PER_TICK: f32;
    /// The core on the crystal, Hz.
    const CORE_HZ: f64;
    /// The address of the DAC's control register.
    const DAC_REGISTERS: u32;
    /// The DAC with its buffer: values of its control register and of others.
    const BUFFERED: &'static [(u32, u32)];
    /// A register that sets an ADC, and another value: resolution, sampling times, the clock of both, on.
    const SPOILED: &'static [(u32, u32)];
    /// A factory's code of the reference that no such chip has.
    const OTHER_FACTORY: u32;
}

macro_rules! on_chip {
    ($kind:ident, $name:literal, $family:ident, $module:ident, $start:ident, $supply_v:literal, $current:expr) => {
        #[derive(Default)]
        pub struct $kind;

        impl Kind for $kind {
            type Bench = $module::Bench;
            const NAME: &'static str = $name;
            const FAMILY: Family = Family::$family;
            const CRYSTAL_HZ: u32 = $module::CRYSTAL_HZ;
            const ID: u16 = $module::ID;
            const CONVERTERS: Converters = $module::CONVERTERS;
            const ENABLE: Pin = Pin::new('C', 6);
            const INTERLOCK: Pin = Pin::new('C', 8);
            const CURRENT: Pin = $current;
            #[cfg(feature = "self-sensing")]
            const CURRENT_V: f32 = $module::CURRENT_V;
            const ON: Drive = Drive { enable: true, dac_v: 1.5, range: CommandRange::TenVolts };
            // Half a code, and half of one of the chip's reference, which is at 1.21 V.
            const STEP_V: f64 = 0.5 * $supply_v / 4096.0 * (1.0 + $supply_v / 1.21);
            const LOADED: f64 = 1500.0 / 1515.0;
            // 24 and 10 kΩ: an operational amplifier of 3.4 behind the DAC, and dividers by as much before the ADCs.
            const GAIN: f32 = 3400.0;
            const SENSOR: Calibration = Calibration::Parabola { offset: -1e-3, gain: 3.4e-3, quadratic: 0.0 };

            fn on(board: &Board) -> Self {
                Self.set_monitor(board, 0.0);
                Self.set_sensor(board, 0.3);
                Self
            }

            fn start(board: &Board, core: Core) -> Self::Bench {
                $start(board, core)
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
                board.chip(|chip| chip.around.shorted = Some((Self::DAC, $supply_v)));
            }

            fn fail_monitor(&self, board: &Board, fails: bool) {
                board.chip(|chip| chip.adcs[0].is_dead = fails);
            }

            fn assert_no_violations(&self, board: &Board) {
                assert_eq!(board.violations(), [], "{}", Self::NAME);
            }
        }
    };
}

on_chip!(Discovery, "STM32F4DISCOVERY", F4, stm32f407_discovery, start_discovery, 3.0, Pin::new('C', 1));
on_chip!(Nucleo, "NUCLEO-G474RE", G4, nucleo_g474re, start_nucleo, 3.3, Pin::new('B', 1));

impl OnChip for Discovery {
    const DAC: Pin = Pin::new('A', 5);
    const MONITOR: Pin = Pin::new('B', 0);
    const SENSOR_PIN: Pin = Pin::new('B', 1);
    const SUPPLY_V: f64 = 3.0;
    const CYCLES_PER_TICK: f32 = stm32f407_discovery::CYCLES_PER_TICK;
    const CORE_HZ: f64 = 168e6;
    const DAC_REGISTERS: u32 = 0x4000_7400;
    const BUFFERED: &'static [(u32, u32)] = &[(0x00, 1 << 16)];
    const SPOILED: &'static [(u32, u32)] =
        &[(0x4001_2004, 1 << 24), (0x4001_2110, 0), (0x4001_2304, 1 << 23), (0x4001_2008, 0)];
    const OTHER_FACTORY: u32 = 1555;
}

impl OnChip for Nucleo {
    const DAC: Pin = Pin::new('A', 4);
    const MONITOR: Pin = Pin::new('A', 0);
    const SENSOR_PIN: Pin = Pin::new('A', 1);
    const SUPPLY_V: f64 = 3.3;
    const CYCLES_PER_TICK: f32 = nucleo_g474re::CYCLES_PER_TICK;
    const CORE_HZ: f64 = 170e6;
    const DAC_REGISTERS: u32 = 0x5000_0800;
    const BUFFERED: &'static [(u32, u32)] = &[(0x00, 0), (0x3c, 0b10 << 14), (0x00, 1)];
    const SPOILED: &'static [(u32, u32)] =
        &[(0x5000_000c, 1 << 31), (0x5000_0118, 0), (0x5000_0308, 1 << 22 | 2 << 16), (0x5000_0008, 0)];
    const OTHER_FACTORY: u32 = 1700;
}
