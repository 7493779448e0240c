//! The flight recorder: what outlives a reset, and what damaged memory yields.

use dea_driver::server::{FlightRecorder, FlightSlot};
use dea_driver::wire::{Answer, Command, FlightRecord, Mode, RECORDS};
use dea_driver::{Cause, DriverState, SensorFault};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::host::Host;

const STATES: [DriverState; 5] = [
    DriverState::Armed,
    DriverState::Running,
    DriverState::Disarmed,
    DriverState::Tripped(Cause::Sensor(SensorFault::Stuck)),
    DriverState::Tripped(Cause::Clock),
];

fn random_record(random: &mut Pcg64) -> FlightRecord {
    FlightRecord {
        tick: random.random(),
        state: STATES[random.random_range(0..STATES.len())],
        command_v: random.random(),
        monitor_v: random.random(),
        displacement_m: random.random(),
        predicted_m: random.random(),
        reference_m: random.random(),
        limited: random.random(),
    }
}

/// From memory of random bits, over resets at random moments, some in the middle of a write: the newest records come back as they were, a damaged
/// one not at all.
#[test]
fn records_outlive_a_reset_and_damage() {
    let mut random = Pcg64::seed_from_u64(13);
    for _ in 0..200 {
        let length = random.random_range(1..40);
        let mut memory: Vec<FlightSlot> = (0..length).map(|_| random.random()).collect();
        let mut pushed = Vec::new();
        for _ in 0..random.random_range(1..6) {
            let mut recorder = FlightRecorder::new(&mut memory);
            for _ in 0..random.random_range(0..60) {
                let record = random_record(&mut random);
                recorder.push(&record, 1000.0);
                pushed.push(record);
            }
            for back in 0..length + 3 {
                let expected = pushed.iter().rev().nth(back).filter(|_| back < length);
                assert_eq!(recorder.record(back as u32).as_ref(), expected, "{back} of {length}");
            }
        }
        // A bit of the newest record flips, or its write was cut off: that record alone is lost.
        if pushed.len() > 1 && length > 1 {
            let newest = pushed.len() % length;
            memory[newest][random.random_range(0..10)] ^= 1 << random.random_range(0..32);
            let recorder = FlightRecorder::new(&mut memory);
            assert_eq!(recorder.record(0), Some(pushed[pushed.len() - 2]));
        }
    }
    // No memory, and memory that no record was written to.
    for memory in [&mut [][..], &mut [[0; 10]; 3], &mut [[u32::MAX; 10]; 3]] {
        let mut recorder = FlightRecorder::new(memory);
        assert_eq!(recorder.record(0), None);
        recorder.push(&random_record(&mut random), 1000.0);
    }
}

/// At any rate the records cover a second for each thousand of them at least, and the end of a run is always there.
#[test]
fn fast_ticks_are_thinned_and_the_end_is_kept() {
    let mut random = Pcg64::seed_from_u64(14);
    for rate_hz in [100.0f32, 1000.0, 1500.0, 5000.0] {
        let mut memory = [[0; 10]; 1000];
        let mut recorder = FlightRecorder::new(&mut memory);
        for tick in 0..20_000 {
            let state = if tick < 19_999 { DriverState::Running } else { DriverState::Tripped(Cause::Arcs) };
            recorder.push(&FlightRecord { tick, state, ..random_record(&mut random) }, rate_hz);
        }
        let ticks: Vec<u32> = (0..1000).map(|back| recorder.record(back).expect("kept").tick).collect();
        assert_eq!(ticks[0], 19_999);
        assert!((ticks[0] - ticks[999]) as f32 / rate_hz > 0.99, "{rate_hz} Hz");
        let longest = ticks.windows(2).map(|pair| pair[0] - pair[1]).max().expect("some");
        assert!(longest as f32 <= (rate_hz / 1000.0).ceil(), "{rate_hz} Hz: {longest} ticks");
    }
}

/// Over the link: a run's ticks with the tick that tripped it at the end, and nothing of the time after it.
#[test]
fn a_host_reads_how_a_run_ended() {
    let mut host = Host::with_parameters();
    assert_eq!(host.ask(Command::FlightRecords { back: 0 }), Answer::FlightRecords([].into_iter().collect()));
    host.arm();
    host.done(Command::Start(Mode::Voltage));
    host.done(Command::SetVoltage(100.0));
    host.ticks(20);
    host.bench.device.trip(Cause::Bus);
    host.ticks(30);
    let mut records = Vec::new();
    while let Answer::FlightRecords(more) = host.ask(Command::FlightRecords { back: records.len() as u16 })
        && !more.is_empty()
    {
        assert!(more.len() <= RECORDS);
        records.extend(more);
    }
    let status = host.status();
    assert_eq!(records[0].state, DriverState::Tripped(Cause::Bus));
    assert_eq!(records[0].command_v, 0.0);
    assert!(records[1].state == DriverState::Running && records[1].command_v > 0.0, "{:?}", records[1]);
    assert!((20..=22).contains(&records.len()), "{}", records.len());
    assert!(records.windows(2).all(|pair| pair[0].tick == pair[1].tick + 1));
    assert!(status.ticks - records[0].tick >= 28);
}
