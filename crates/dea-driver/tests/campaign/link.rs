//! The board's side of the link behind a line with bit errors of 1e-3 to 1e-6, bytes lost and doubled as often, stalls of 0.3 s and 1 s
//! of either direction about every 20 s, while a host plays a voltage and a stream of records runs.
//!
//! Pass: with errors of 1e-5 and less nothing but a stall of 1 s towards the board trips it, and the host plays again afterwards; every
//! record that is missing at the host is evident from the tick numbers of its neighbours, and by `dropped` where the board dropped it; every
//! frame that does not arrive as it was sent is counted, answered with number 0, and leaves the device as it was, bit by bit; the only
//! cause is `Heartbeat`, in the first tick after `heartbeat_s` without an accepted request, with the amplifier disabled.
//!
//! 12 runs of 30 s in the sample, 48 of 10 min of virtual time in full.

use std::collections::{BTreeMap, HashSet, VecDeque};

use dea_driver::server::Session;
use dea_driver::wire::{Answer, Command, FRAME_LEN, Message, Receiver, Request};
use dea_driver::{Cause, DriverState, Inputs, RamFlash, Telemetry};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::bench::{board_parameters, encoded};
use crate::board::{BOARD, Bench, ask, frame};
use crate::line::{Line, Stall, Way};
use crate::player::Player;
use crate::scale::cases;

/// Bytes that the firmware keeps in either direction.
const RECEIVED: usize = 512;
const SENDING: usize = 512;
/// Ticks without an accepted request after which it trips, at 0.5 s and 1 kHz.
const HEARTBEAT: u32 = 501;
const ERRORS: [f64; 4] = [1e-6, 1e-5, 1e-4, 1e-3];
const STREAMS: [u16; 3] = [10, 2, 1];

/// The firmware around its session, an amplifier and a film that follow.
struct Firmware {
    bench: Bench,
    session: Session,
    received: VecDeque<u8>,
    film_m: f32,
    random: Pcg64,
    /// Bytes since the last zero, as they were served.
    chunk: Vec<u8>,
    /// Frames that were not sent so.
    damaged: u32,
    obeyed: u32,
    /// Tick of the last request that keeps it enabled.
    accepted: u32,
    records: Vec<Telemetry>,
    trips: Vec<u32>,
    lost_bytes: u32,
}

impl Firmware {
    fn new(random: Pcg64, every: u16) -> Self {
        let mut bench = Bench::new(RamFlash::default(), None);
        bench.store.save(&encoded(&board_parameters(), BOARD)).expect("empty");
        let mut session = Session::new("1.2.3");
        session.begin(&mut bench).expect("valid parameters");
        assert_eq!(bench.rate_hz, 1000.0);
        bench.device.stream(every);
        Self {
            bench,
            session,
            received: VecDeque::new(),
            film_m: 0.0,
            random,
            chunk: Vec::new(),
            damaged: 0,
            obeyed: 0,
            accepted: 0,
            records: Vec::new(),
            trips: Vec::new(),
            lost_bytes: 0,
        }
    }

    fn hear(&mut self, byte: u8) {
        if self.received.len() < RECEIVED {
            self.received.push_back(byte);
        } else {
            self.lost_bytes += 1;
        }
    }

    fn tick(&mut self, now: u32) {
        // 1000 V per volt, 0.15 mm at 1 kV.
        let dac_v = self.bench.drive.dac_v;
        self.film_m += 0.02 * (0.15e-3 * dac_v * dac_v - self.film_m);
        let noise_m = 1e-6 * self.random.random::<f32>();
        let monitor_adc_v = Some(dac_v);
        let sensor_adc_v = Some(1.0 + (self.film_m + noise_m) * 1e3);
        let was_live = self.bench.device.state().is_live();
        self.bench.tick(Inputs { interlock_closed: true, monitor_adc_v, sensor_adc_v });
        let drive = self.bench.drive;
        match self.bench.device.state() {
            DriverState::Tripped(cause) => {
                assert_eq!(cause, Cause::Heartbeat, "in {now} ms");
                assert!(!drive.enable && drive.dac_v == 0.0);
                if was_live {
                    assert_eq!(now - self.accepted, HEARTBEAT, "in {now} ms");
                    self.trips.push(now);
                }
            }
            state => assert!(!state.is_live() || now - self.accepted < HEARTBEAT, "in {now} ms"),
        }
        assert!((0.0..=3.001).contains(&drive.dac_v), "{} V were never asked for", drive.dac_v);
    }

    /// The background of the firmware: requests as long as there is room for an answer, then records.
    fn serve(&mut self, now: u32, sent: &HashSet<Vec<u8>>, line: &mut Line) {
        while line.room(SENDING) > FRAME_LEN
            && let Some(byte) = self.received.pop_front()
        {
            if let Some(message) = self.serve_byte(byte, now, sent) {
                line.send(&frame(&message));
            }
        }
        while line.room(SENDING) > FRAME_LEN
            && let Some(record) = self.bench.device.telemetry()
        {
            self.records.push(record);
            line.send(&frame(&Message::Telemetry(record)));
        }
    }

    fn serve_byte(&mut self, byte: u8, now: u32, sent: &HashSet<Vec<u8>>) -> Option<Message> {
        if byte != 0 {
            self.chunk.push(byte);
            let nothing = self.session.serve(byte, &mut self.bench);
            assert_eq!(nothing, None);
            return None;
        }
        let chunk = std::mem::take(&mut self.chunk);
        let is_intact = sent.contains(&chunk);
        let before = (!is_intact).then(|| format!("{:?}", self.bench.device));
        let message = self.session.serve(0, &mut self.bench);
        if chunk.is_empty() {
            assert_eq!(message, None);
        } else if let Some(before) = before {
            self.damaged += 1;
            let rejects = matches!(message, Some(Message::Answer { sequence: 0, answer: Answer::Rejected(_) }));
            assert!(rejects, "{message:?}");
            assert_eq!(before, format!("{:?}", self.bench.device), "a damaged frame was obeyed");
        } else {
            self.obeyed += 1;
            let request = decoded(&chunk);
            let Some(Message::Answer { sequence, answer }) = &message else { panic!("no answer") };
            assert_eq!(*sequence, request.sequence);
            let keeps = matches!(request.command, Command::Heartbeat | Command::SetVoltage(_) | Command::Start(_));
            if keeps && *answer == Answer::Done || matches!(answer, Answer::Armed { .. }) {
                self.accepted = now;
            }
        }
        message
    }
}

fn decoded(frame: &[u8]) -> Request {
    let mut receiver = Receiver::new();
    frame.iter().for_each(|&byte| assert!(receiver.push::<Request>(byte).is_none()));
    receiver.push(0).expect("a frame").expect("as it was sent")
}

struct Run {
    firmware: Firmware,
    player: Player,
    /// Ticks in which the line to the board began to stall for a second.
    long_stalls: Vec<u32>,
}

fn run(number: u64, errors: f64, every: u16, duration_ms: u32) -> Run {
    let mut random = Pcg64::seed_from_u64(number);
    let mut fork = || Pcg64::seed_from_u64(random.random());
    let (mut up, mut down) = (Line::new(Way::ToBoard, errors, fork()), Line::new(Way::ToHost, errors, fork()));
    let mut firmware = Firmware::new(fork(), every);
    let mut player = Player::new();
    let mut sent = HashSet::new();
    let (mut stall_at, mut stall_ends, mut long_stalls) = (8000, 0, Vec::new());
    for now in 0..duration_ms {
        if now == stall_at {
            let kind = if random.random_bool(0.5) { Stall::Holds } else { Stall::Loses };
            let length_ms = if random.random_bool(0.5) { 300 } else { 1000 };
            stall_ends = now + length_ms;
            stall_at = now + random.random_range(5_000..35_000u32);
            if random.random_bool(0.7) {
                up.stall = Some(kind);
                if length_ms > HEARTBEAT {
                    long_stalls.push(now);
                }
            } else {
                down.stall = Some(kind);
            }
        }
        if now == stall_ends {
            (up.stall, down.stall) = (None, None);
        }
        player.send(now, |frame| {
            sent.insert(frame[..frame.len() - 1].to_vec());
            up.send(frame);
        });
        up.carry(|byte| firmware.hear(byte));
        firmware.tick(now);
        firmware.serve(now, &sent, &mut down);
        down.carry(|byte| player.receive(byte));
    }
    Run { firmware, player, long_stalls }
}

/// Records that the host did not get: those that the board dropped, and those that the line lost.
fn gaps(run: &Run, every: u16) -> (u32, u32) {
    let (mut dropped, mut lost) = (0, 0);
    let mut sent = run.firmware.records.iter();
    let mut last: Option<u32> = None;
    for record in &run.player.records {
        let mut between = 0;
        loop {
            let next = sent.next().expect("the host has no record that was not sent");
            between += next.dropped;
            dropped += next.dropped;
            if next == record {
                break;
            }
            between += 1;
            lost += 1;
        }
        // What the host sees: the ticks between two records.
        if let Some(last) = last {
            let ticks = record.tick - last;
            assert_eq!(ticks % u32::from(every), 0);
            assert_eq!(ticks / u32::from(every) - 1, between, "a gap that is not reported, at tick {}", record.tick);
        }
        last = Some(record.tick);
    }
    (dropped, lost)
}

/// The counts of damaged frames that the board states.
fn stated(firmware: &mut Firmware) -> u32 {
    // What is still on its way ends here, with the damage that it adds.
    let open = !firmware.chunk.is_empty();
    let first = firmware.session.serve(0, &mut firmware.bench);
    assert_eq!(first.is_some(), open);
    firmware.damaged += u32::from(matches!(first, Some(Message::Answer { sequence: 0, .. })));
    match ask(&mut firmware.session, &mut firmware.bench, (1, 0), Command::Status) {
        Answer::Status(status) => status.damaged_frames + status.unknown_frames,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_bad_line_neither_trips_nor_moves_a_film() {
    let (number, duration_s) = (cases(12, 48), cases(30, 600) as u32);
    let mut lines: BTreeMap<(usize, u16), Vec<String>> = BTreeMap::new();
    for number in 0..number {
        let at = number as usize % ERRORS.len();
        let (errors, every) = (ERRORS[at], STREAMS[(number as usize / ERRORS.len()) % STREAMS.len()]);
        let mut run = run(number, errors, every, 1000 * duration_s);
        let (dropped, lost) = gaps(&run, every);
        assert_eq!(stated(&mut run.firmware), run.firmware.damaged, "damaged frames");
        let Run { firmware, player, long_stalls } = run;
        // A trip belongs to the stall that began within the last second.
        let by_stall = |&&trip: &&u32| long_stalls.iter().any(|&start| (start..start + 1100).contains(&trip));
        let alone = firmware.trips.len() - firmware.trips.iter().filter(by_stall).count();
        let stalls_over = long_stalls.iter().filter(|&&start| start + 1000 < 1000 * duration_s).count();
        if errors <= 1e-5 {
            assert_eq!(alone, 0, "false trips of run {number}: {:?}, stalls {long_stalls:?}", firmware.trips);
            let (trips, states) = (&firmware.trips, &player.states);
            assert!(
                trips.len() >= stalls_over,
                "run {number}: a stall without 0 V {trips:?} {long_stalls:?} {states:?}"
            );
        }
        assert!(firmware.obeyed > 50 * duration_s, "run {number}: only {} requests arrived", firmware.obeyed);
        // After the last stall it plays again, unless that was just now.
        let settled = firmware.trips.last().is_none_or(|&trip| trip + 5000 < 1000 * duration_s);
        assert!(!settled || errors > 1e-4 || player.plays(), "run {number} does not play at the end");
        lines.entry((at, every)).or_default().push(format!(
            "{} frames intact, {} damaged; {} trips in {} stalls of 1 s, {alone} without; records: {} received, \
             {lost} lost on the line, {dropped} dropped; {} bytes overflowed",
            firmware.obeyed,
            firmware.damaged,
            firmware.trips.len() - alone,
            long_stalls.len(),
            player.records.len(),
            firmware.lost_bytes
        ));
    }
    println!("link: {number} runs of {duration_s} s");
    for ((at, every), lines) in lines {
        for line in lines {
            println!("  errors {:.0e}, a record every {every} ticks: {line}", ERRORS[at]);
        }
    }
}
