//! The link: every message comes through, nothing damaged is executed.

use dea_driver::server::Upload;
use dea_driver::wire::{
    Answer, BATCH, CHUNK, Command, FRAME_LEN, FlightRecord, Followed, FrameError, Identity, Inspection, Message, Mode,
    Part, RECORDS, REFUSALS, Receiver, Reject, Request, Status, Step, Target, Telemetry, TickCodes, Ticked, VERSION,
    encode,
};
use dea_driver::{BLOB_LEN, Cause, Device, DriverState, Refusal, SensorFault};

use crate::board::{frame, inspection};
use crate::film_bench::FilmBench;
use crate::link_page;

fn receive<T: serde::de::DeserializeOwned>(receiver: &mut Receiver, bytes: &[u8]) -> Vec<Result<T, FrameError>> {
    bytes.iter().filter_map(|&byte| receiver.push(byte)).collect()
}

/// Every command, and the largest of those whose sizes vary.
fn commands() -> Vec<Command> {
    let codes = TickCodes { interlock_closed: true, monitor: u16::MAX, sensor: u16::MAX, target: 1.0 };
    let largest = [
        Command::Upload { offset: 511, bytes: [0xff; CHUNK].into() },
        Command::Step([0.0; BATCH].into()),
        Command::Step([f32::MAX; BATCH].into()),
        Command::Follow { mode: Mode::Tracking, targets: [Target { value: 1.0, sample_m: Some(2.0) }; BATCH].into() },
        Command::Tick { mode: Mode::Tracking, inputs: [codes; BATCH].into() },
    ];
    link_page::commands().into_iter().chain(largest).collect()
}

/// Messages with the largest numbers of those whose length depends on them.
fn messages() -> Vec<Message> {
    let status = Status {
        state: DriverState::Tripped(Cause::Sensor(SensorFault::Stuck)),
        ticks: u32::MAX,
        tripped_at: u32::MAX,
        damaged_frames: u32::MAX,
        unknown_frames: u32::MAX,
        stack_peak: u32::MAX,
        lost_bytes: u32::MAX,
        falls: u16::MAX,
        monitor_v: f32::MAX,
        ..Device::new(None).status()
    };
    let step = Step { displacement_m: -f32::MAX, force_n: f32::MAX, voltage_v: f32::MIN_POSITIVE };
    let followed = Followed { voltage_v: 1.0, displacement_m: 2.0, disturbance_n: 3.0 };
    let shown = FilmBench::new().tick(|_| ()).telemetry;
    let record = Telemetry { tick: u32::MAX, dropped: u32::MAX, limited: u8::MAX, ..shown };
    let identity = Identity {
        protocol: VERSION,
        schema: u16::MAX,
        board: u16::MAX,
        firmware: "0123456789abcdef".try_into().expect("short"),
    };
    let part = Part::Wrong { wanted: u16::MAX, found: u16::MAX };
    let inspection = Inspection { dac: part, monitor: part, sensor: part, ..inspection(true, true) };
    let ticked = Ticked {
        enable: true,
        command: u16::MAX,
        state: DriverState::Tripped(Cause::Sensor(SensorFault::Stuck)),
        predicted_m: 11.0,
    };
    let flight = FlightRecord::new(&record, DriverState::Tripped(Cause::Sensor(SensorFault::Stuck)));
    let answers = [
        Answer::FlightRecords([flight; RECORDS].into()),
        Answer::Preflight {
            refusals: [Refusal::Sensor(SensorFault::Stuck); REFUSALS].into(),
            self_test_s: Some(u32::MAX),
        },
        Answer::Done,
        Answer::Armed { token: u16::MAX },
        Answer::Refused(Refusal::State(DriverState::Running)),
        Answer::Rejected(Reject::Damaged),
        Answer::Identity(identity),
        Answer::Status(status),
        Answer::Parameters {
            name: "a name of thirty-two characters.".try_into().expect("short"),
            checksum: Some(u32::MAX),
        },
        Answer::Steps { steps: [step; BATCH].into(), cycles: u32::MAX },
        Answer::Followed { ticks: [followed; BATCH].into(), cycles: u32::MAX },
        Answer::Inspection(inspection),
        Answer::Ticked { ticks: [ticked; BATCH].into(), cycles: u32::MAX },
        Answer::PanicMessage(["0123456789"; 20].concat().as_str().try_into().expect("short")),
    ];
    answers
        .into_iter()
        .map(|answer| Message::Answer { sequence: u32::MAX, answer })
        .chain([Message::Telemetry(record)])
        .collect()
}

#[test]
fn every_message_comes_through() {
    let mut receiver = Receiver::new();
    for command in commands() {
        let request = Request { sequence: 0x1234_5678, token: 0x5678, command };
        let bytes = frame(&request);
        assert!(bytes.len() <= FRAME_LEN && !bytes[..bytes.len() - 1].contains(&0));
        assert_eq!(receive(&mut receiver, &bytes), [Ok(request)]);
    }
    let mut longest = 0;
    for message in messages() {
        let bytes = frame(&message);
        longest = longest.max(bytes.len());
        assert_eq!(receive(&mut receiver, &bytes), [Ok(message)]);
    }
    println!("longest message: {longest} bytes");
    assert!(longest <= FRAME_LEN);
    assert_eq!((receiver.damaged(), receiver.unknown()), (0, 0));
}

/// Flip any bit of a frame: whatever comes out, it is not a message. The receiver is ready for the next frame.
#[test]
fn no_damaged_frame_is_executed() {
    for command in commands() {
        let request = Request { sequence: 7, token: 8, command };
        let bytes = frame(&request);
        let mut receiver = Receiver::new();
        for bit in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            let found: Vec<Result<Request, FrameError>> = receive(&mut receiver, &damaged);
            assert!(found.iter().all(Result::is_err), "bit {bit} of {request:?}: {found:?}");
            // A zero that became something else runs into the next frame; a second zero ends that.
            receive::<Request>(&mut receiver, &[0]);
            assert_eq!(receive(&mut receiver, &bytes), [Ok(request.clone())], "after bit {bit}");
        }
        assert!(receiver.damaged() as usize >= 8 * bytes.len() - 8, "every damaged frame is counted");
    }
}

#[test]
fn unknown_and_overlong_frames_are_distinguished() {
    let mut receiver = Receiver::new();
    // A command that this version does not know, and one with more behind it than it should have.
    assert_eq!(receive::<Request>(&mut receiver, &frame(&(1u16, 0u16, 200u8))), [Err(FrameError::Unknown)]);
    assert_eq!(receive::<Request>(&mut receiver, &frame(&(1u16, 0u16, 0u8, 0u8))), [Err(FrameError::Unknown)]);
    assert_eq!(receive::<Request>(&mut receiver, &[b'x'; 5000]), []);
    assert_eq!(receive::<Request>(&mut receiver, &[0]), [Err(FrameError::TooLong)]);
    assert_eq!((receiver.damaged(), receiver.unknown()), (1, 2));
    // Zeros alone are not frames.
    assert_eq!(receive::<Request>(&mut receiver, &[0; 100]), []);
    let mut small = [0; 10];
    let request = Request { sequence: 1, token: 0, command: Command::Step([0.0; BATCH].into()) };
    assert_eq!(encode(&request, &mut small), Err(FrameError::TooLong));
}

#[test]
fn uploads_are_whole_or_refused() {
    let blob: Vec<u8> = (0..BLOB_LEN).map(|k| (k * 7) as u8).collect();
    let mut upload = Upload::new();
    for (index, piece) in blob.chunks(CHUNK).enumerate() {
        upload.push(index * CHUNK, piece).expect("in order");
    }
    assert_eq!(upload.finish(BLOB_LEN), Ok(blob.as_slice()));
    // Finished is finished.
    assert_eq!(upload.finish(BLOB_LEN), Err(Reject::Upload));
    upload.push(0, &blob[..100]).expect("begins again");
    assert_eq!(upload.push(101, &blob[..10]), Err(Reject::Upload));
    assert_eq!(upload.finish(200), Err(Reject::Upload), "truncated");
    upload.push(0, &blob[..100]).expect("begins again");
    upload.push(100, &blob[100..]).expect("follows");
    assert_eq!(upload.push(BLOB_LEN, &[1]), Err(Reject::Upload));
    assert_eq!(Upload::new().finish(0), Err(Reject::Upload));
}
