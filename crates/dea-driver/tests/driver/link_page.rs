//! The table of commands in `doc/link.md`, against the device: the number of each command, and the states in which it is refused.

use dea_driver::wire::{Answer, CHUNK, Command, InjectedFault, Reject, Target};
use dea_driver::{AdaptationOrder, Cause, DriverState, LearningOrder, Mode, Refusal};

use crate::host::{Host, blob};

/// A row: the number, the command's name, and the states as the page has them.
fn rows() -> Vec<(u8, String, String)> {
    let page = include_str!("../../doc/link.md");
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows = page.lines().map(cells).filter(|cells| cells.len() == 7);
    rows.filter_map(|cells| Some((cells[1].parse().ok()?, cells[2].replace('`', ""), cells[5].clone()))).collect()
}

/// A command for each row, as a board takes it.
pub fn commands() -> Vec<Command> {
    let length = blob().len() as u16;
    vec![
        Command::Identify,
        Command::Heartbeat,
        Command::Status,
        Command::Arm,
        Command::Start(Mode::Voltage),
        Command::Stop,
        Command::Disarm,
        Command::Acknowledge,
        Command::SetVoltage(100.0),
        Command::SetReference(0.1e-3),
        Command::Upload { offset: 0, bytes: [0; CHUNK].into() },
        Command::Commit { length },
        Command::Query,
        Command::Stream { every: 10 },
        Command::Rest,
        Command::Step([0.0].into_iter().collect()),
        Command::Try { length },
        Command::PanicMessage,
        Command::InjectFault(InjectedFault::Hang),
        Command::Follow { mode: Mode::Voltage, targets: [Target { value: 0.0, sample_m: None }].into_iter().collect() },
        Command::Reload,
        Command::Inspect,
        Command::StopFeedingWatchdog,
        Command::Tick { mode: Mode::Voltage, inputs: [].into_iter().collect() },
        Command::Learning(LearningOrder::CarryOver),
        Command::FlightRecords { back: 0 },
        Command::Preflight,
        Command::SelfTested,
        Command::ArmForSelfTest,
        Command::Adapt(AdaptationOrder::Learn { trip_at: 3.0 }),
        Command::Adaptation,
    ]
}

/// A host whose board is in this state, with parameters kept, and uploaded again.
fn reach(state: DriverState) -> Host {
    let mut host = Host::with_parameters();
    assert_eq!(host.commit(&blob()), Answer::Done);
    host.upload(&blob());
    host.tick();
    // Only what is enabled trips.
    if state != DriverState::Disarmed {
        host.arm();
    }
    if state == DriverState::Running {
        host.done(Command::Start(Mode::Voltage));
    }
    if let DriverState::Tripped(cause) = state {
        host.bench.device.trip(cause);
    }
    assert_eq!(host.state(), state);
    host
}

#[test]
fn each_command_is_refused_outside_its_states() {
    let rows = rows();
    let commands = commands();
    assert_eq!(rows.len(), commands.len(), "one row for each command");
    for ((number, name, states), command) in rows.into_iter().zip(commands) {
        assert_eq!(postcard::to_slice(&command, &mut [0; 256]).expect("fits")[0], number, "{name}");
        assert!(format!("{command:?}").starts_with(&name), "{name}: {command:?}");
        for (state, named) in [
            (DriverState::Disarmed, "disarmed"),
            (DriverState::Armed, "armed"),
            (DriverState::Running, "running"),
            (DriverState::Tripped(Cause::Overrun), "tripped"),
        ] {
            let taken = match states.as_str() {
                "all" => true,
                "all but tripped" => named != "tripped",
                list => list.split(", ").any(|state| state == named),
            };
            let answer = reach(state).ask(command.clone());
            assert_eq!(answer != Answer::Refused(Refusal::State(state)), taken, "{name}, {named}: {answer:?}");
        }
    }
}

/// A value beyond the limits is refused in every state.
#[test]
fn values_beyond_the_limits_are_rejected_in_every_state() {
    for state in [DriverState::Disarmed, DriverState::Armed, DriverState::Running, DriverState::Tripped(Cause::Overrun)]
    {
        let mut host = reach(state);
        for command in [
            Command::SetVoltage(7000.0),
            Command::SetVoltage(f32::NAN),
            Command::SetReference(9e-3),
            Command::SetReference(f32::NAN),
        ] {
            let answer = host.ask(command.clone());
            assert_eq!(answer, Answer::Rejected(Reject::Value), "{command:?}, {state:?}");
        }
    }
}
