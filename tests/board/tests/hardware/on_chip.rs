//! `firmware/src/on_chip.rs`: faults of converters on the chip, of their reference, and of the models that judge them. Tests of what the chips share run
//! on one of them.

use board_on_host::board::Board;
use board_on_host::chip::Block;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::violation::Violation;
use board_on_host::f4::on_chip::MAX_SUPPLY_CHANGE;
use board_on_host::hal::prelude::*;
use dea_driver::AmplifierError;
use dea_driver::wire::Part;

use super::kinds::{
    Discovery, Kind, Nucleo, OnChip, SET_UP, Ticks, assert_near, board_of, is_enabled, on_chip_boards, run, tick,
};
use super::start::{CLOCKS, Core, crystal, set_g4};

/// A board that has been on for some ticks.
fn started<K: OnChip>() -> (Board, K::Bench) {
    let (board, _) = board_of::<K>();
    let mut bench = K::start(&board, Core::Crystal);
    run::<K>(&board, &mut bench, [K::OFF; SET_UP]);
    (board, bench)
}

/// The same with its amplifier enabled.
fn enabled<K: OnChip>() -> (Board, K::Bench) {
    let (board, mut bench) = started::<K>();
    run::<K>(&board, &mut bench, [K::ON; 3]);
    assert!(is_enabled::<K>(&board));
    (board, bench)
}

/// 3 V are no reference of their own: readings and command follow the chip's.
fn volts_are_volts_at_every_supply<K: OnChip>() {
    for core in CLOCKS {
        for supply_v in [0.94, 0.983, 1.0, 1.033, 1.06].map(|share| share * K::SUPPLY_V) {
            let (board, wired) = board_of::<K>();
            board.chip(|chip| chip.around.supply_v = supply_v);
            wired.set_monitor(&board, 1.234);
            wired.set_sensor(&board, 2.345);
            let mut bench = K::start(&board, core);
            run::<K>(&board, &mut bench, [K::OFF, K::OFF, K::ON, K::ON]);
            let (inputs, _) = tick(&board, &mut bench, K::ON);
            assert_near::<K>(inputs.monitor_adc_v, 1.234);
            assert_near::<K>(inputs.sensor_adc_v, 2.345);
            let wanted = f64::from(K::ON.dac_v) * K::LOADED;
            let found = wired.command_v(&board);
            assert!((found - wanted).abs() < K::STEP_V, "{supply_v} V: {found} V instead of {wanted} V");
            assert_eq!(board.violations(), []);
        }
    }
}

/// While it runs as well, within the mean of its measurement.
#[test]
fn a_supply_that_drifts_is_followed() {
    let (board, mut bench) = started::<Discovery>();
    board.chip(|chip| chip.around.supply_v *= 3.1 / 3.0);
    Discovery.set_monitor(&board, 1.5);
    run::<Discovery>(&board, &mut bench, [Discovery::ON; 400]);
    // A code more of the reference is what the supply may be off.
    let found = tick(&board, &mut bench, Discovery::ON).0.monitor_adc_v.expect("a reading");
    assert!((f64::from(found) - 1.5).abs() < 2.0 * Discovery::STEP_V, "{found} V");
}

/// The film's voltage is off by as much as the reference is, which the monitor does not see: the page states how far.
#[test]
fn a_reference_that_fails_later_is_noticed_before_the_share_on_the_page() {
    let share = 100.0 * MAX_SUPPLY_CHANGE;
    let row = format!("\n| the same with a reference that fails later | 0: two references | {share:.0} %");
    assert!(include_str!("../../../../docs/boards.md").contains(&row));
    let (board, mut bench) = started::<Discovery>();
    let mut largest = 1.0_f64;
    for _ in 0..1000 {
        // The mean is behind it by 64 ticks.
        board.chip(|chip| chip.around.reference_v *= 1.0001);
        if tick(&board, &mut bench, Discovery::ON).1.is_err() {
            break;
        }
        largest = largest.max(Discovery.command_v(&board) / (f64::from(Discovery::ON.dac_v) * Discovery::LOADED));
    }
    assert!(!is_enabled::<Discovery>(&board));
    let end = 1.0 + f64::from(MAX_SUPPLY_CHANGE);
    assert!((end - 0.01..end + 0.001).contains(&largest), "{largest}");
}

/// Readings of the others are without value then, and so is the command.
fn a_supply_or_a_reference_outside_of_its_range_ends_in_the_tick<K: OnChip>() {
    type Spoil = fn(&Board);
    let faults: [(&str, Spoil); 11] = [
        ("supply too low", |board| board.chip(|chip| chip.around.supply_v *= 2.75 / 3.0)),
        ("supply too high", |board| board.chip(|chip| chip.around.supply_v *= 3.25 / 3.0)),
        ("reference too low", |board| board.chip(|chip| chip.around.reference_v *= 0.9)),
        ("reference too high", |board| board.chip(|chip| chip.around.reference_v *= 1.1)),
        ("factory's code erased", |board| board.chip(|chip| chip.around.factory = 0xffff)),
        // Within the range, and further from the first than a regulator goes.
        ("supply that falls", |board| board.chip(|chip| chip.around.supply_v *= 2.86 / 3.0)),
        ("supply that rises", |board| board.chip(|chip| chip.around.supply_v *= 3.15 / 3.0)),
        ("reference that falls", |board| board.chip(|chip| chip.around.reference_v *= 0.95)),
        ("reference that rises", |board| board.chip(|chip| chip.around.reference_v *= 1.05)),
        // The supply would be in its range.
        ("factory's code of another chip", |board| board.chip(|chip| chip.around.factory = K::OTHER_FACTORY)),
        ("ADC1 always the same", |board| board.chip(|chip| chip.adcs[0].always = Some(2048))),
    ];
    for (name, spoil) in faults {
        let (board, mut bench) = enabled::<K>();
        spoil(&board);
        let (inputs, applied) = tick(&board, &mut bench, K::ON);
        assert_eq!((inputs.monitor_adc_v, inputs.sensor_adc_v), (None, None), "{name}");
        assert_eq!(applied, Err(AmplifierError::Bus), "{name}");
        assert!(!is_enabled::<K>(&board), "{name}");
        assert_eq!(K::default().command_v(&board), 0.0, "{name}");
        assert!(matches!(bench.inspection().monitor, Part::Wrong { .. }), "{name}: {:?}", bench.inspection());
        // Nor is it enabled again.
        assert!(tick(&board, &mut bench, K::ON).1.is_err(), "{name}");
        assert!(!is_enabled::<K>(&board), "{name}");
    }
}

fn a_dac_that_does_not_drive_its_pin_disables_the_amplifier_a_tick_later<K: OnChip>() {
    type Spoil = fn(&Board);
    let faults: [(&str, Spoil); 6] = [
        ("shorted to ground", |board| board.chip(|chip| chip.around.shorted = Some((K::DAC, 0.0)))),
        ("shorted to the supply", |board| board.chip(|chip| chip.around.shorted = Some((K::DAC, K::SUPPLY_V)))),
        ("off by 5 %", |board| board.chip(|chip| chip.around.shorted = Some((K::DAC, 1.5 * 1.05)))),
        ("ADC2 always the same", |board| board.chip(|chip| chip.adcs[1].always = Some(1000))),
        ("switched off", |board| board.chip(|chip| chip.write(K::DAC_REGISTERS, 0))),
        ("with its buffer", |board| {
            board.chip(|chip| K::BUFFERED.iter().for_each(|&(at, value)| chip.write(K::DAC_REGISTERS + at, value)))
        }),
    ];
    for (name, spoil) in faults {
        let (board, mut bench) = enabled::<K>();
        spoil(&board);
        assert!(matches!(tick(&board, &mut bench, K::ON).1, Err(AmplifierError::Readback { .. })), "{name}");
        assert!(!is_enabled::<K>(&board), "{name}");
    }
}

fn a_dac_that_takes_no_codes_is_noticed_with_the_next_command<K: OnChip>() {
    let (board, mut bench) = started::<K>();
    board.chip(|chip| chip.dac.holds = Some(0));
    assert_eq!(tick(&board, &mut bench, K::ON).1, Ok(()));
    assert!(matches!(tick(&board, &mut bench, K::ON).1, Err(AmplifierError::Readback { found: 0, .. })));
    assert!(!is_enabled::<K>(&board));
}

/// Its pin would not show it: a DAC may be off by more.
fn a_dac_that_holds_a_code_beside_its_own_is_noticed<K: OnChip>() {
    let (board, mut bench) = enabled::<K>();
    // A bit of its register that has flipped.
    let other = (1.5 / K::SUPPLY_V * 4096.0).round() as u16 + 8;
    board.chip(|chip| chip.dac.holds = Some(other.into()));
    assert_eq!(tick(&board, &mut bench, K::ON).1, Ok(()));
    assert!(matches!(tick(&board, &mut bench, K::ON).1, Err(AmplifierError::Readback { found, .. }) if found == other));
    assert!(!is_enabled::<K>(&board));
}

/// None of its readings is that of a conversion before.
fn an_adc_that_never_ends_a_conversion_has_no_readings<K: OnChip>() {
    for index in 0..2 {
        let (board, mut bench) = enabled::<K>();
        board.chip(|chip| chip.adcs[index].is_dead = true);
        let (inputs, applied) = tick(&board, &mut bench, K::ON);
        assert_eq!((inputs.monitor_adc_v, inputs.sensor_adc_v), (None, None), "ADC{}", index + 1);
        let found = bench.inspection();
        assert_eq!((applied, found.monitor, found.sensor), (Err(AmplifierError::Bus), Part::Bus, Part::Bus));
        assert!(!is_enabled::<K>(&board), "ADC{}", index + 1);
    }
}

/// An ADC whose registers have changed is not believed, and set up again.
fn an_adc_whose_registers_have_changed_is_set_up_again<K: OnChip>() {
    // Resolution, sampling times, and the clock of both.
    for &(address, value) in K::SPOILED {
        let (board, mut bench) = started::<K>();
        K::default().set_monitor(&board, 1.0);
        board.chip(|chip| chip.write(address, value));
        assert_eq!(tick(&board, &mut bench, K::OFF).0.monitor_adc_v, None, "{address:#x}");
        assert_near::<K>(tick(&board, &mut bench, K::OFF).0.monitor_adc_v, 1.0);
    }
}

/// The noise of the reference does not hide a sensor that always converts to the same.
#[test]
fn a_stuck_sensor_stays_the_same_to_the_bit_on_a_noisy_reference() {
    let (board, mut bench) = started::<Discovery>();
    board.chip(|chip| {
        chip.around.noise = 2;
        chip.adcs[1].always = Some(1500);
    });
    let readings: Vec<_> = (0..700).map(|_| tick(&board, &mut bench, Discovery::OFF).0.sensor_adc_v).collect();
    let first = readings[200].expect("a reading").to_bits();
    let changed = readings[200..].iter().filter(|reading| reading.map(f32::to_bits) != Some(first)).count();
    assert_eq!(changed, 0);
}

/// With two codes of noise the mean is within one of them.
#[test]
fn the_mean_of_a_tick_has_less_noise_than_a_sample() {
    let (board, mut bench) = started::<Discovery>();
    board.chip(|chip| chip.around.noise = 2);
    Discovery.set_monitor(&board, 1.0);
    let code_v = Discovery::SUPPLY_V / 4096.0;
    let readings: Vec<f64> =
        (0..500).map(|_| tick(&board, &mut bench, Discovery::OFF).0.monitor_adc_v.expect("a reading").into()).collect();
    let mean = readings.iter().sum::<f64>() / readings.len() as f64;
    let variance = readings.iter().map(|reading| (reading - mean).powi(2)).sum::<f64>() / readings.len() as f64;
    // Even noise of ±2 codes has 1.15 codes, and a mean of eight 0.41; rounding adds 0.1.
    let deviation = variance.sqrt() / code_v;
    assert!((0.3..0.55).contains(&deviation), "{deviation} codes");
    assert!((mean - 1.0).abs() < 2.0 * code_v, "{mean} V");
}

/// The board's `CYCLES_PER_TICK` leaves 7 200 cycles for the controller on the internal oscillator, and so does its fastest tick, of 5 kHz, on the
/// crystal's clock. A wait takes up to half again as long as it is asked to on this core.
fn conversions_leave_time_for_the_controller<K: OnChip>() {
    for (core, hz, cycles_per_tick) in
        [(Core::Internal, 16e6, f64::from(K::CYCLES_PER_TICK)), (Core::Crystal, K::CORE_HZ, K::CORE_HZ / 5000.0)]
    {
        let (board, _) = board_of::<K>();
        let mut bench = K::start(&board, core);
        assert_eq!(tick(&board, &mut bench, K::OFF).1, Ok(()));
        let before = board.chip(|chip| chip.now_ns());
        bench.sample();
        #[cfg(feature = "self-sensing")]
        {
            // The codes of a tick of 1 kHz, 84 or 219 at the most, are added in eight cycles each.
            assert!(bench.current_adc_v(1000.0).is_none());
            board.chip(|chip| chip.wait_cycles(8 * if core == Core::Internal { 84 } else { 219 }));
        }
        assert_eq!(bench.apply(K::OFF), Ok(()));
        let cycles = 1.5 * (board.chip(|chip| chip.now_ns()) - before) as f64 * 1e-9 * hz;
        assert!(cycles + 7200.0 < cycles_per_tick, "{cycles} cycles at {hz} Hz");
    }
}

#[test]
fn the_models_find_what_they_are_there_to_find() {
    let board = Board::new(Oscillators::default());
    let chip = board.peripherals();
    let mut rcc = chip.RCC.freeze(crystal());
    // SAFETY: the clocks of DAC, ADC1 and ADC2.
    rcc.apb2enr().modify(|r, w| unsafe { w.bits(r.bits() | 1 << 8 | 1 << 9) });
    let _ = chip.GPIOA.split(&mut rcc);
    let (adc1, adc2) = (&chip.ADC1, &chip.ADC2);
    let convert = |adc: &board_on_host::hal::pac::adc1::RegisterBlock, channel: u32| {
        // SAFETY: the models take what comes.
        unsafe {
            adc.sqr3().write(|w| w.bits(channel));
            adc.cr2().write(|w| w.bits(1 << 30 | 1));
        }
        board.chip(|chip| chip.wait_ns(100_000));
    };
    convert(adc1, 0);
    let pin = Pin::new('A', 0);
    let early = Violation::ConversionNotReady { adc: 1 };
    let fast = Violation::ConverterClock { hz: 42_000_000 };
    assert_eq!(board.violations(), [early, fast, Violation::NotAnalog { pin }]);
    // Without its switch, sampled for too short a time, and by an ADC that does not have it.
    convert(adc1, 17);
    assert_eq!(board.violations().last(), Some(&Violation::ReferenceNotSampled { adc: 1 }));
    // SAFETY: as above.
    unsafe {
        chip.ADC_COMMON.ccr().write(|w| w.bits(1 << 23 | 1 << 16));
        adc2.cr2().write(|w| w.bits(1));
        adc2.smpr1().write(|w| w.bits(0b111 << 21));
    }
    board.chip(|chip| chip.wait_ns(10_000));
    convert(adc2, 17);
    assert_eq!(board.violations().last(), Some(&Violation::ReferenceNotSampled { adc: 2 }));
    let _ = chip.DAC.cr().read().bits();
    assert_eq!(board.violations().last(), Some(&Violation::NoClock(Block::Dac)));
}

/// Those of an STM32G4.
#[test]
fn the_models_find_what_they_are_there_to_find_on_the_other_chip() {
    let board = board_of::<Nucleo>().0;
    set_g4(Core::Crystal);
    let write = |address: u32, value: u32| board.chip(|chip| chip.write(address, value));
    let convert = |adc: u32, channel: u32| {
        write(0x5000_0030 + (adc - 1) * 0x100, channel << 6);
        write(0x5000_0008 + (adc - 1) * 0x100, 1 << 28 | 1 | 1 << 2);
        board.chip(|chip| chip.wait_ns(100_000));
    };
    // Clocks of ports, ADCs and DAC; ADCs at a half of the core's; one that is calibrated without its regulator, and one that is switched on without that.
    write(0x4002_104c, 0b111 | 1 << 13 | 1 << 16);
    write(0x5000_0308, 2 << 16);
    write(0x5000_0008, 1 << 28 | 1 << 31);
    write(0x5000_0108, 1 << 28 | 1);
    let not_ready = [1, 2].map(|adc| Violation::ConversionNotReady { adc });
    assert_eq!(board.violations(), not_ready);
    board.chip(|chip| chip.wait_ns(50_000));
    write(0x5000_0008, 1 << 28 | 1);
    board.chip(|chip| chip.wait_ns(50_000));
    // Too fast; the reference without its switch, and by an ADC that does not have it; a pin that is not analog.
    convert(1, 18);
    let fast = Violation::ConverterClock { hz: 85_000_000 };
    assert_eq!(board.violations()[2..], [Violation::ReferenceNotSampled { adc: 1 }, fast]);
    write(0x5000_0308, 1 << 22 | 3 << 16);
    write(0x5000_0118, 0b111 << 24);
    convert(2, 18);
    assert_eq!(board.violations().last(), Some(&Violation::ReferenceNotSampled { adc: 2 }));
    write(0x4800_0000, 0xabff_fff3);
    convert(1, 2);
    assert_eq!(board.violations().last(), Some(&Violation::NotAnalog { pin: Pin::new('A', 1) }));
    // The mode of a channel that is on does not change.
    write(0x5000_0800, 1);
    write(0x5000_083c, 0b010);
    assert_eq!(board.chip(|chip| chip.peek(0x5000_083c)), 0);
}

on_chip_boards!(
    volts_are_volts_at_every_supply,
    a_supply_or_a_reference_outside_of_its_range_ends_in_the_tick,
    a_dac_that_does_not_drive_its_pin_disables_the_amplifier_a_tick_later,
    a_dac_that_takes_no_codes_is_noticed_with_the_next_command,
    a_dac_that_holds_a_code_beside_its_own_is_noticed,
    an_adc_that_never_ends_a_conversion_has_no_readings,
    an_adc_whose_registers_have_changed_is_set_up_again,
    conversions_leave_time_for_the_controller
);
