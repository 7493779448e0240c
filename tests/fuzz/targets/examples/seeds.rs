//! Writes the inputs that fuzzing began with: `cargo run -p fuzz-targets --example seeds -- FOLDER`.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

use dea_driver::wire::{Command, InjectedFault, Mode, Target, TickCodes};
use fuzz_targets::{GOOD_BLOB, seal};
use host_sim::files::parameters::{Board, Parameters};
use springpot::Preset;

type Inputs = Vec<Vec<u8>>;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(env::args().nth(1).ok_or("name a folder")?);
    write(&folder.join("frames"), &frames()?)?;
    write(&folder.join("blobs"), &blobs())?;
    write(&folder.join("recordings"), &recordings())?;
    write(&folder.join("parameter-files"), &parameter_files()?)?;
    Ok(())
}

fn write(folder: &Path, inputs: &Inputs) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    for (index, input) in inputs.iter().enumerate() {
        fs::write(folder.join(format!("seed-{index:02}")), input)?;
    }
    Ok(())
}

fn record(kind: u8, bytes: &[u8]) -> Vec<u8> {
    [&[kind, bytes.len() as u8], bytes].concat()
}

fn commands() -> Vec<Command> {
    vec![
        Command::Identify,
        Command::Heartbeat,
        Command::Status,
        Command::Arm,
        Command::Start(Mode::Voltage),
        Command::Start(Mode::Feedforward),
        Command::Start(Mode::Tracking),
        Command::SetVoltage(3000.0),
        Command::SetReference(0.5e-3),
        Command::Stop,
        Command::Disarm,
        Command::Acknowledge,
        Command::Commit { length: GOOD_BLOB.len() as u16 },
        Command::Query,
        Command::Stream { every: 3 },
        Command::Rest,
        Command::Step([500.0; 2].into_iter().collect()),
        Command::Try { length: GOOD_BLOB.len() as u16 },
        Command::PanicMessage,
        Command::InjectFault(InjectedFault::Hang),
        Command::Follow {
            mode: Mode::Tracking,
            targets: [Target { value: 1e-4, sample_m: None }, Target { value: 1e-4, sample_m: Some(1e-5) }]
                .into_iter()
                .collect(),
        },
        Command::Reload,
        Command::Inspect,
        Command::StopFeedingWatchdog,
        Command::Tick {
            mode: Mode::Voltage,
            inputs: [(0, 400.0), (1, 500.0)]
                .map(|(monitor, target)| TickCodes { interlock_closed: true, monitor, sensor: 6400, target })
                .into_iter()
                .collect(),
        },
    ]
}

/// Every command from the host that armed, from another, and as it comes over the line; runs in every mode, and an upload.
fn frames() -> Result<Inputs, Box<dyn Error>> {
    let bytes = |command: &Command| postcard::to_extend(command, Vec::new());
    let own = |command: Command| -> Result<Vec<u8>, postcard::Error> { Ok(record(2, &bytes(&command)?)) };
    let ticks = |faults: u8, count: u8| record(3, &[faults, count]);
    let mut inputs = Inputs::new();
    for command in commands() {
        let other = [&[1, 0], bytes(&command)?.as_slice()].concat();
        let line = seal(&other);
        inputs.push([vec![0], ticks(0, 1), record(2, &bytes(&command)?), record(1, &other), record(0, &line)].concat());
    }
    let (voltage, reference) = (Command::SetVoltage(2000.0), Command::SetReference(0.2e-3));
    for (mode, target) in
        [(Mode::Voltage, voltage), (Mode::Feedforward, reference.clone()), (Mode::Tracking, reference)]
    {
        for faults in [0u8, 1, 2, 4, 8] {
            let begun =
                [vec![0], ticks(0, 1), own(Command::Arm)?, own(Command::Start(mode))?, own(target.clone())?].concat();
            let run =
                [ticks(0, 100), own(target.clone())?, ticks(faults, 200), own(Command::Heartbeat)?, ticks(0, 255)];
            let end = [own(Command::Stop)?, own(Command::Disarm)?, own(Command::Acknowledge)?, ticks(0, 255)];
            inputs.push([begun, run.concat(), end.concat()].concat());
        }
    }
    for keep in [Command::Commit { length: GOOD_BLOB.len() as u16 }, Command::Try { length: GOOD_BLOB.len() as u16 }] {
        let mut input = vec![3];
        for (index, piece) in GOOD_BLOB.chunks(128).enumerate() {
            let bytes = piece.iter().copied().collect();
            input.extend(own(Command::Upload { offset: (index * 128) as u16, bytes })?);
        }
        input.extend([own(keep)?, own(Command::Acknowledge)?, ticks(0, 1), own(Command::Arm)?, ticks(0, 9)].concat());
        inputs.push(input);
    }
    Ok(inputs)
}

fn blobs() -> Inputs {
    let contents = &GOOD_BLOB[10..GOOD_BLOB.len() - 4];
    let mut inputs = vec![[&[0], GOOD_BLOB.as_slice()].concat(), [&[1], contents].concat(), vec![2], vec![3]];
    let slot = |sequence: u32| {
        let header = [sequence.to_le_bytes(), (!sequence).to_le_bytes()].concat();
        let mut slot = [header, GOOD_BLOB.clone()].concat();
        slot.resize(1000, 0xff);
        slot
    };
    for (first, second) in [(1, 2), (2, 1), (0, u32::MAX)] {
        inputs.push([vec![2], slot(first), slot(second)].concat());
        for held in [0x00, 0x01, 0x10, 0x20, 0x02, 0x80, 0x08, 0x40, 0x11] {
            inputs.push([&[3], &u32::to_le_bytes(first)[..], &u32::to_le_bytes(second), &[held], contents].concat());
        }
    }
    inputs
}

fn recordings() -> Inputs {
    [
        "time_s,voltage_v,displacement_m\n0,0,0\n0.1,100,1e-6\n0.2,200,4e-6\n",
        "# a comment\ntime_ms;voltage_kv\r\n0,0\r\n1,1\r\n",
        "time_ms,voltage_kv,displacement_mm\r\n0,0,0\r\n1,1,\r\n2,2,0.1\r\n",
        "\u{feff}time_s,force_n,displacement_um\r0,1,2\r1,2,3\r",
        "time_s,voltage_v,note\n0,1,\"a, b\"\n1,2,\"c\"\n",
        "time_s,voltage_v\n0,1\n0,2\n",
        "time_s,voltage_v\n0,NaN\n1,1e300\n",
        "time_s,voltage_v,voltage_kv\n0,1,1\n",
        "time_s,voltage_v\n0,\"1\n",
        "time_s,displacement_m\n0,1\n",
        "",
    ]
    .map(|text| text.as_bytes().to_vec())
    .to_vec()
}

fn parameter_files() -> Result<Inputs, Box<dyn Error>> {
    let mut inputs = Inputs::new();
    for preset in Preset::ALL {
        let mut parameters = Parameters::preset(preset.name())?;
        inputs.push(parameters.to_toml().into_bytes());
        parameters.board = Some(Board::bench(&parameters.actuator));
        parameters.sensor_offset_m = 1e-4;
        parameters.provenance = Some("origin = 'a fit'\nR2 = [0.9, 0.8]".parse()?);
        inputs.push(parameters.to_toml().into_bytes());
    }
    Ok(inputs)
}
