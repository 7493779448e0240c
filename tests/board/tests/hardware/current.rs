//! `firmware/src/current.rs` and the registers of ADC3 and its DMA: the mean current of a tick, and what leaves a tick without it.

use std::f64::consts::FRAC_PI_2;

use board_on_host::board::Board;
use board_on_host::chip::Block;
use board_on_host::chip::family::Family;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::violation::Violation;

use super::kinds::{Kind, SET_UP, Ticks, assert_near, board_of, on_every_board};
use super::start::{CLOCKS, Core};

/// Time constants of the filter at the pin and of the film's electrodes, ns.
const FILTER_NS: f64 = 70e3;
const FILM_NS: f64 = 35e3;

/// The current of a step, behind the filter, so long after it (ns), for a charge of 1 (1/ns).
pub fn peak(since_ns: f64) -> f64 {
    let fall = |constant_ns: f64| (-since_ns / constant_ns).exp();
    (fall(FILTER_NS) - fall(FILM_NS)) / (FILTER_NS - FILM_NS)
}

/// Its charge in the time until then (ns).
fn charge(until_ns: f64) -> f64 {
    let part = |constant_ns: f64| constant_ns * (1.0 - (-until_ns / constant_ns).exp());
    (part(FILTER_NS) - part(FILM_NS)) / (FILTER_NS - FILM_NS)
}

/// Readings of so many ticks at `rate_hz` (Hz), V. Every third one is late by `late_ns` (ns).
fn readings<K: Kind>(board: &Board, bench: &mut K::Bench, rate_hz: f64, late_ns: u64, ticks: u64) -> Vec<f64> {
    let tick_ns = (1e9 / rate_hz) as u64;
    let start = (board.chip(|chip| chip.now_ns()) / tick_ns + 1) * tick_ns;
    let one = |tick: u64| {
        let begin = start + tick * tick_ns + if tick % 3 == 2 { late_ns } else { 0 };
        board.chip(|chip| chip.wait_ns(begin - chip.now_ns()));
        bench.sample();
        let current_v = bench.current_adc_v(rate_hz as f32);
        assert_eq!(bench.apply(K::OFF), Ok(()), "{}", K::NAME);
        current_v.map_or(f64::NAN, f64::from)
    };
    (0..ticks).map(one).collect()
}

/// The tone: peaks of both directions at a monitor that is a fifth off the middle. Its amplitude is the charge of a peak by the time of a tick, neither the
/// number of codes in a tick changes it, which may vary with the tone, nor a tick that is late.
fn the_mean_of_a_tick_is_the_charge_of_its_current<K: Kind>() {
    let shares: &[f64] = if K::CONVERTERS.command_v.is_some() { &[0.95, 1.0, 1.05] } else { &[1.0] };
    for (core, &share) in CLOCKS.into_iter().flat_map(|core| shares.iter().map(move |share| (core, share))) {
        for rate_hz in [250.0, 500.0, 1000.0] {
            let (board, _) = board_of::<K>();
            let supply_v = share * board.chip(|chip| chip.around.supply_v);
            board.chip(|chip| chip.around.supply_v = supply_v);
            let mut bench = K::start(&board, core);
            let (tick_ns, rest_v) = (1e9 / rate_hz, 0.4 * supply_v);
            // Of 1.1 V at the highest.
            let charge_v_ns = 1.1 / peak(48.5e3);
            let mut measured = |charge_v_ns: f64, ticks: u64| {
                let volts = move |now: u64| {
                    let tick = (now as f64 / tick_ns - 0.4).floor();
                    let sign = if matches!(tick as u64 % 4, 0 | 3) { 1.0 } else { -1.0 };
                    rest_v + sign * charge_v_ns * peak(now as f64 - (tick + 0.4) * tick_ns)
                };
                board.chip(|chip| chip.around.course = Some((K::CURRENT, Box::new(volts))));
                readings::<K>(&board, &mut bench, rate_hz, 24_000, ticks)
            };
            measured(0.0, 4);
            let rest = measured(0.0, 12)[4..].iter().sum::<f64>() / 8.0;
            let found = measured(charge_v_ns, 52)[4..].to_vec();
            let [mut real, mut imaginary] = [0.0; 2];
            for (tick, volts) in found.iter().enumerate() {
                let (sine, cosine) = (FRAC_PI_2 * tick as f64).sin_cos();
                (real, imaginary) = (real + volts * cosine, imaginary + volts * sine);
            }
            // Four peaks of a period are as a sine of √2 times one.
            let wanted_v = charge_v_ns * charge(tick_ns) / tick_ns;
            let off = real.hypot(imaginary) * 2.0 / found.len() as f64 / (2f64.sqrt() * wanted_v) - 1.0;
            let furthest =
                found.iter().map(|volts| (volts - rest).abs() / wanted_v - 1.0).map(f64::abs).fold(0.0, f64::max);
            let off = [off, furthest];
            let case = format!("{} {core:?} {supply_v:.2} V {rate_hz} Hz: {off:.5?} of {wanted_v:.3} V", K::NAME);
            println!("{case}");
            // Half a code of the chip's reference, of 1500, and of ADC3.
            assert!((rest - rest_v).abs() < rest_v / 3000.0 + 5e-4, "{case}, rest {} V", rest - rest_v);
            // With few codes in a tick of the internal oscillator.
            let most = if core == Core::Crystal { [1e-3, 6e-3] } else { [2e-3, 5e-2] };
            assert!(off[0].abs() < most[0] && off[1] < most[1], "{case}");
            assert_eq!(board.violations(), []);
        }
    }
}

/// A fault: its name, and what it does.
type Fault = (&'static str, fn(&Board));

/// A fault of the converter shortly before a tick, which has all its codes but no reading: registers that have changed, by their addresses and values,
/// and codes that a DMA without its clock did not take.
fn faults(family: Family) -> Vec<Fault> {
    macro_rules! set {
        ($($name:literal $address:literal $value:expr),*) => {
            vec![$(($name, |board| board.chip(|chip| chip.write($address, $value)))),*]
        };
    }
    if family == Family::F4 {
        return set!(
            "off" 0x4001_2208 0, "once" 0x4001_2208 0x301, "ten bits" 0x4001_2204 1 << 24, "fast" 0x4001_220c 0, "other pin" 0x4001_2234 10,
            "stream off" 0x4002_6410 0, "no clock of the stream" 0x4002_3830 0b1_1111
        );
    }
    set!(
        "once" 0x5000_040c 0x8000_0003, "gained" 0x5000_0410 1, "fast" 0x5000_0414 0, "other pin" 0x5000_0430 5 << 6,
        "channel off" 0x4002_0008 0, "other request" 0x4002_0800 36, "no clock of the channel" 0x4002_1048 4
    )
}

/// It has no reading in that tick, right ones soon after, and nothing else of the bench changes.
fn a_fault_of_the_converter_leaves_a_tick_without_a_reading<K: Kind>() {
    let late: Fault = ("late by more than the ring", |board| board.chip(|chip| chip.wait_ns(5_500_000)));
    let dead: Fault = ("converts no more", |board| board.chip(|chip| chip.adcs[2].is_dead = true));
    for (name, spoil) in faults(K::FAMILY).into_iter().chain([late, dead]) {
        let (board, wired) = board_of::<K>();
        wired.set_monitor(&board, 1.0);
        wired.set_sensor(&board, 2.0);
        board.chip(|chip| chip.put(K::CURRENT, 1.5));
        let mut bench = K::start(&board, Core::Crystal);
        let mut tick = |before: &dyn Fn()| {
            let due = board.chip(|chip| (chip.now_ns() / 1_000_000 + 1) * 1_000_000);
            let wait_until = |time: u64| board.chip(|chip| chip.wait_ns(time.saturating_sub(chip.now_ns())));
            wait_until(due - 20_000);
            before();
            wait_until(due);
            // The clock of the DMA is back.
            let (gate, on) = if K::FAMILY == Family::F4 { (0x4002_3830, 1 << 22) } else { (0x4002_1048, 0b101) };
            board.chip(|chip| {
                let gates = chip.peek(gate);
                chip.write(gate, gates | on)
            });
            let inputs = bench.sample();
            (inputs, bench.current_adc_v(1000.0), bench.apply(K::OFF))
        };
        for _ in 0..SET_UP {
            let _ = tick(&|| ());
        }
        // One that is dead has the codes from before in the first tick.
        let first = if name == dead.0 { tick(&|| spoil(&board)).1.is_some() } else { false };
        let mut found: Vec<_> = [tick(&|| {
            if !first {
                spoil(&board)
            }
        })]
        .into();
        board.chip(|chip| chip.adcs[2].is_dead = false);
        found.extend((0..6).map(|_| tick(&|| ())));
        // A reading of a bus is that of the tick before.
        let lost = usize::from(K::CONVERTERS.command_v.is_none());
        for (index, (inputs, current_v, applied)) in found.into_iter().enumerate() {
            let case = format!("{}, {name}, tick {index}: {current_v:?}", K::NAME);
            assert_eq!(applied, Ok(()), "{case}");
            assert_near::<K>(inputs.monitor_adc_v, 1.0);
            assert_near::<K>(inputs.sensor_adc_v, 2.0);
            assert!(current_v.is_none_or(|volts| (volts - 1.5).abs() < 6e-3), "{case}");
            assert!(if index == lost { current_v.is_none() } else { index < 5 || current_v.is_some() }, "{case}");
        }
        // The other pin's.
        let violations = board.violations().into_iter().filter(|found| !matches!(found, Violation::NotAnalog { .. }));
        assert_eq!(violations.collect::<Vec<_>>(), [], "{}, {name}", K::NAME);
    }
}

#[test]
fn the_models_find_what_they_are_there_to_find() {
    let board = Board::new(Oscillators::default());
    let write = |address: u32, value: u32| board.chip(|chip| chip.write(address, value));
    let last = || board.violations().last().copied();
    let (adc, stream) = (0x4001_2200, 0x4002_6410);
    write(stream, 1);
    assert_eq!(last(), Some(Violation::NoClock(Block::Dma)));
    write(adc + 8, 1);
    assert_eq!(last(), Some(Violation::NoClock(Block::Adc(3))));
    // Clocks of port C, DMA, ADC1 and ADC3.
    write(0x4002_3830, 1 << 2 | 1 << 22);
    write(0x4002_3844, 1 << 8 | 1 << 10);
    // All the time, from a pin that is not analog, at once; half words to another address.
    for (offset, value) in [(4, 16), (8, adc + 0x4c), (12, 0x2000_0000), (0, 0x0400_2d01)] {
        write(stream + offset, value);
    }
    write(adc + 0x34, 11);
    write(adc + 8, 0x4000_0303);
    assert_eq!(last(), Some(Violation::ConversionNotReady { adc: 3 }));
    board.chip(|chip| chip.wait_ns(10_000));
    let address = 0x2000_0000;
    let pin = Pin::new('C', 1);
    assert_eq!(board.violations()[3..], [Violation::NotAnalog { pin }, Violation::DmaTarget { address }]);
    write(stream + 4, 8);
    assert_eq!(last(), Some(Violation::DmaSetWhileOn));
    // Another channel of the stream takes no code: the next one is lost.
    write(stream, 0);
    write(0x4002_6408, 0x3d);
    write(stream, 0x0200_2d01);
    board.chip(|chip| chip.wait_ns(100_000));
    assert_eq!(board.chip(|chip| chip.peek(adc)) & 1 << 5, 1 << 5);
}

on_every_board!(
    the_mean_of_a_tick_is_the_charge_of_its_current,
    a_fault_of_the_converter_leaves_a_tick_without_a_reading
);
