//! Single bits that flip in the memory of a controller: in its parameters, laws, limits, states and set-points, and on the stack of a tick.
//!
//! Each case takes a controller that runs in one of the modes, with the film as its own sensor as well, or is disarmed, armed or tripped, flips one bit at a random moment, lets it go
//! on for 0.4 s, and then makes one thing happen that has to end at 0 V: the interlock opens, the host is silent, the monitor reads 0 V, the amplifier gives
//! 1.6 times its command, the sensor is unplugged, the host disarms. The film and its amplifier are not in that memory. On the stack a bit flips
//! between two instructions of the tick: the processor traps after each of them.
//!
//! A case ends **safely** if it goes on within its limits and ends as it would without the flip, or at 0 V, disabled and latched; also where
//! the program panics, faults or hangs, which disables the chip's amplifier by its handlers or its watchdog. **Late**: it ends at 0 V in more
//! than the time that is promised. **Dangerous**: it does not end at 0 V, is enabled again, or before that the film has more voltage than
//! the monitor's limit for longer than 25 ms, or goes beyond 1.1 times its stroke.
//!
//! A process of its own runs the cases, since some of them end it: `in_this_process`.
//!
//! Cases: 1e5, a quarter each over the supervisor and set-points, the parameters, all of the controller, and the stack; 2000 in the sample.

mod world;

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::{Command as Process, Stdio};

use dea_driver::wire::Command;
use dea_driver::{Cause, Controller, DriverState, Inputs, Motion, Supervisor};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::scale::cases;
use crate::stack;
use world::{DOINGS, ENDS, EVENTS, Event, World, tick};

/// Ticks within which a bit flips, until something happens, and after it has ended.
const FLIPS: u32 = 40;
const GOES_ON: u32 = 400;
const STAYS: u32 = 100;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Supervisor,
    Parameters,
    Controller,
    Stack,
}

const PLACES: [Place; 4] = [Place::Supervisor, Place::Parameters, Place::Controller, Place::Stack];

/// Bytes of a device, from its start, that a board without the loop test has as well.
struct Map {
    supervisor: Vec<usize>,
    parameters: Vec<usize>,
    controller: Vec<usize>,
}

impl Map {
    fn new(world: &World) -> Self {
        let device = &world.bench.device;
        let start = std::ptr::from_ref(device) as usize;
        let controller = device.controller().expect("installed");
        let within = |at: usize, length: usize| (at - start..at - start + length).collect::<Vec<_>>();
        let front = size_of::<Supervisor>() + size_of::<Motion>() + 80;
        let at = std::ptr::from_ref(controller) as usize;
        let parameters = controller.parameters();
        // The loop test is the last field of a controller.
        let used = size_of::<Controller>() - loop_test_bytes(controller);
        Self {
            supervisor: within(at, front),
            parameters: within(std::ptr::from_ref(parameters) as usize, size_of_val(parameters)),
            controller: within(at, used),
        }
    }

    fn of_place(&self, place: Place) -> &[usize] {
        match place {
            Place::Supervisor => &self.supervisor,
            Place::Parameters => &self.parameters,
            Place::Controller | Place::Stack => &self.controller,
        }
    }
}

/// Bytes from the first one that the loop test changes to the end of a controller.
fn loop_test_bytes(controller: &Controller) -> usize {
    let mut stepped = Box::new(controller.clone());
    let bytes = |controller: &Controller| -> Vec<u8> {
        let start = std::ptr::from_ref(controller).cast::<u8>();
        // SAFETY: the bytes belong to the controller; those between its fields are whatever they are.
        (0..size_of::<Controller>()).map(|at| unsafe { start.add(at).read_volatile() }).collect()
    };
    let before = bytes(&stepped);
    stepped.step(1000.0);
    let after = bytes(&stepped);
    let first = before.iter().zip(&after).position(|(before, after)| before != after).expect("it steps");
    size_of::<Controller>() - first
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// As without the flip: every drive is the same.
    Same,
    /// Within its limits, and as promised.
    Sound,
    /// Tripped before anything happened: by the check of the memory, or another one.
    Memory,
    Tripped,
    /// At 0 V, later than promised.
    Late,
    Dangerous(&'static str),
}

/// A case: the world of `doing`, in which a bit flips.
fn run(index: u64, worlds: &[World], map: &Map, steps: u64) -> End {
    let mut random = Pcg64::seed_from_u64(0xf11b ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let place = PLACES[index as usize % PLACES.len()];
    let mut world = Box::new(worlds[random.random_range(0..worlds.len())].clone());
    let (event, allowed) = EVENTS[random.random_range(0..EVENTS.len())];
    let flips_at = random.random_range(0..FLIPS);
    let mut twin = world.clone();
    let mut differs = false;
    for tick in 0..FLIPS + GOES_ON {
        let mut flip = None;
        if tick == flips_at {
            if place == Place::Stack {
                flip = Some(stack::Flip { after: random.random_range(0..steps), pick: random.random() });
            } else {
                let bytes = map.of_place(place);
                let at = bytes[random.random_range(0..bytes.len())];
                let bit = random.random_range(0..8);
                // SAFETY: the byte belongs to the device. What the program makes of it is the subject.
                unsafe {
                    let byte = std::ptr::from_mut(&mut world.bench.device).cast::<u8>().add(at);
                    byte.write_volatile(byte.read_volatile() ^ 1 << bit);
                }
            }
        }
        world.advance(flip);
        twin.advance(None);
        differs |= world.drive != twin.drive;
    }
    let tripped = match world.state() {
        DriverState::Tripped(cause) if twin.state() != world.state() => Some(cause),
        _ => None,
    };
    if !world.drive.enable {
        // It stays at 0 V, whatever the host goes on sending.
        for _ in 0..STAYS {
            world.advance(None);
            if world.drive.enable {
                world.danger = world.danger.or(Some("enabled again"));
            }
        }
        if let Some(danger) = world.danger {
            return End::Dangerous(danger);
        }
        return match tripped {
            Some(Cause::Memory) => End::Memory,
            Some(_) => End::Tripped,
            None if differs => End::Tripped,
            None => End::Same,
        };
    }
    world.event = Some(event);
    let mut ended = None;
    // Of the last ticks.
    let mut highest_v = 0.0f64;
    for tick in 1..=ENDS {
        if event == Event::Disarm && tick == 1 {
            world.ask(Command::Disarm);
        }
        world.advance(None);
        highest_v = if tick < ENDS / 2 { 0.0 } else { highest_v.max(world.film_v) };
        if !world.drive.enable {
            ended = Some(tick);
            break;
        }
    }
    for _ in 0..STAYS {
        world.advance(None);
        if ended.is_some() && world.drive.enable {
            world.danger = world.danger.or(Some("enabled again"));
        }
    }
    // A monitor that reads 0 V, an amplifier with too much gain and a frozen sensor show only where there is a voltage.
    let shows = highest_v > 200.0 || !matches!(event, Event::Monitor | Event::Amplifier | Event::Overdriven);
    match (world.danger, ended) {
        (Some(danger), _) => End::Dangerous(danger),
        (None, None) if shows => End::Dangerous("it does not end"),
        (None, Some(tick)) if tick > allowed => End::Late,
        _ if differs => End::Sound,
        _ => End::Same,
    }
}

/// Runs the cases that the process which started this one asks for: `SPRINGPOT_FLIPS=from-to`. A line for each.
#[test]
#[ignore = "bits that flip may end the process: the test below starts it"]
fn in_this_process() {
    let Some(range) = std::env::var("SPRINGPOT_FLIPS").ok() else { return };
    let (from, to) = range.split_once('-').expect("a range");
    let (from, to): (u64, u64) = (from.parse().expect("a number"), to.parse().expect("a number"));
    std::panic::set_hook(Box::new(|_| ()));
    let worlds: Vec<World> = DOINGS.map(World::new).into();
    let map = Map::new(&worlds[0]);
    let mut counted = worlds[2].clone();
    let steps = stack::count(|| {
        tick(
            &mut counted.bench.device,
            Inputs { interlock_closed: true, monitor_adc_v: Some(1.0), sensor_adc_v: Some(1.0) },
        )
    });
    let mut out = std::io::stdout();
    for index in from..to {
        stack::end_process_after(20);
        let end = catch_unwind(AssertUnwindSafe(|| run(index, &worlds, &map, steps)));
        let end = end.map_or_else(|_| "Panics".to_owned(), |end| format!("{end:?}"));
        writeln!(out, "\nflip {index} {end}").expect("written");
        out.flush().expect("written");
    }
}

/// The ends of these cases, by their numbers; a process that a flip has ended is one of them.
fn ends(from: u64, to: u64) -> Vec<(u64, String)> {
    let mut ends = Vec::new();
    let mut next = from;
    while next < to {
        let mut process = Process::new(std::env::current_exe().expect("known"))
            .args(["--exact", "flips::in_this_process", "--ignored", "--nocapture"])
            .env("SPRINGPOT_FLIPS", format!("{next}-{to}"))
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("runs");
        let lines = BufReader::new(process.stdout.take().expect("piped")).lines();
        for line in lines.map_while(Result::ok) {
            let Some((index, end)) = line.strip_prefix("flip ").and_then(|rest| rest.split_once(' ')) else { continue };
            assert_eq!(index, next.to_string());
            ends.push((next, end.to_owned()));
            next += 1;
        }
        let status = process.wait().expect("ends");
        if next < to {
            assert!(!status.success() && next >= from, "{status}");
            ends.push((next, "Faults".to_owned()));
            next += 1;
        }
    }
    ends
}

#[test]
fn a_bit_that_flips_ends_safely() {
    let all = cases(2000, 100_000);
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(8) as u64;
    let found: Vec<(u64, String)> = std::thread::scope(|scope| {
        let parts =
            (0..workers).map(|worker| scope.spawn(move || ends(all * worker / workers, all * (worker + 1) / workers)));
        let parts: Vec<_> = parts.collect();
        parts.into_iter().flat_map(|part| part.join().expect("runs")).collect()
    });
    assert_eq!(found.len() as u64, all);
    let mut counts = BTreeMap::<(Place, String), u32>::new();
    for (index, end) in &found {
        *counts.entry((PLACES[*index as usize % PLACES.len()], end.clone())).or_default() += 1;
    }
    println!("flips: {all} {counts:#?}");
    let dangerous: Vec<_> = found.iter().filter(|(_, end)| end.starts_with("Dangerous")).collect();
    assert!(dangerous.is_empty(), "{dangerous:?}");
    let late = found.iter().filter(|(_, end)| end == "Late").count() as u64;
    let memory = found.iter().filter(|(_, end)| end == "Memory").count();
    println!("flips: {:.3} % end safely", 100.0 * (all - late) as f64 / all as f64);
    assert!(100 * late <= all, "{late} of {all} end late");
    // The check of the memory is what ends most of them.
    assert!(memory as u64 * 8 > all, "{memory}");
}
