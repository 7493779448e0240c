//! Writes the inputs of the corpora that hold a blob, for a new schema: `cargo run -p fuzz-targets --example seeds -- FOLDER`.

use std::error::Error;
use std::{env, fs};

use dea_driver::wire::Command;
use fuzz_targets::GOOD_BLOB;

type Inputs = Vec<Vec<u8>>;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = env::args().nth(1).ok_or("name a folder")?;
    for (name, inputs) in [("frames", uploads()?), ("blobs", blobs())] {
        fs::create_dir_all(format!("{folder}/{name}"))?;
        for (index, input) in inputs.iter().enumerate() {
            fs::write(format!("{folder}/{name}/seed-{index:02}"), input)?;
        }
    }
    Ok(())
}

/// A blob that is uploaded and kept, or tried, and a run with it.
fn uploads() -> Result<Inputs, postcard::Error> {
    let length = GOOD_BLOB.len() as u16;
    [Command::Commit { length }, Command::Try { length }]
        .map(|keep| {
            let pieces = GOOD_BLOB.chunks(128).enumerate();
            let mut commands: Vec<Command> = pieces
                .map(|(index, piece)| Command::Upload {
                    offset: (index * 128) as u16,
                    bytes: piece.iter().copied().collect(),
                })
                .collect();
            commands.extend([keep, Command::Acknowledge, Command::Arm]);
            let mut input = vec![3];
            for command in commands {
                let bytes = postcard::to_extend(&command, Vec::new())?;
                input.extend([&[2, bytes.len() as u8], bytes.as_slice(), &[3, 2, 0, 9]].concat());
            }
            Ok(input)
        })
        .into_iter()
        .collect()
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
