//! The firmware's log through defmt.
//!
//! defmt sends two bytes for a message, the address of a symbol that is named after its text, and then the arguments. The names are
//! in the symbol table of the program that runs.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::{env, fs};

/// How serious a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Info,
    Warning,
    Error,
}

/// A message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    pub level: Level,
    /// With its places for arguments.
    pub text: String,
    /// Arguments as they are sent: text as text, after its length.
    pub arguments: Vec<u8>,
}

static FRAMES: Mutex<Vec<Vec<u8>>> = Mutex::new(Vec::new());

fn frames() -> MutexGuard<'static, Vec<Vec<u8>>> {
    FRAMES.lock().unwrap_or_else(PoisonError::into_inner)
}

#[defmt::global_logger]
struct Logger;

// SAFETY: one board at a time has the process, and it logs from one thread.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        frames().push(Vec::new());
    }

    unsafe fn flush() {}

    unsafe fn release() {}

    unsafe fn write(bytes: &[u8]) {
        if let Some(frame) = frames().last_mut() {
            frame.extend_from_slice(bytes);
        }
    }
}

defmt::timestamp!("");

/// Takes what was logged so far.
///
/// # Panics
///
/// Where a message is not in the symbol table.
pub fn take() -> Vec<Line> {
    std::mem::take(&mut *frames()).iter().map(|frame| line(frame)).collect()
}

fn line(frame: &[u8]) -> Line {
    let [low, high, rest @ ..] = frame else { panic!("a message without a text: {frame:02x?}") };
    let index = u16::from_le_bytes([*low, *high]);
    let Some((_, name)) = messages().iter().find(|(address, _)| *address == index) else {
        panic!("message {index:#x} is not in the symbol table")
    };
    let field = |key: &str| {
        let start = name.find(key).map_or(0, |at| at + key.len());
        name[start..].split("\",\"").next().unwrap_or_default()
    };
    let level = match field("\"tag\":\"") {
        "defmt_error" => Level::Error,
        "defmt_warn" => Level::Warning,
        _ => Level::Info,
    };
    Line { level, text: field("\"data\":\"").to_owned(), arguments: rest.to_vec() }
}

/// Messages by the lower half of their addresses.
fn messages() -> &'static [(u16, String)] {
    static MESSAGES: OnceLock<Vec<(u16, String)>> = OnceLock::new();
    MESSAGES.get_or_init(|| {
        let program = env::current_exe().and_then(fs::read).unwrap_or_default();
        symbols(&program).unwrap_or_default()
    })
}

/// Messages in the symbol table of a program: ELF of 64 bits, little-endian.
fn symbols(program: &[u8]) -> Option<Vec<(u16, String)>> {
    unsafe extern "C" {
        #[link_name = "__ehdr_start"]
        static PROGRAM: u8;
    }
    const SYMBOL_TABLE: usize = 2;
    let number = |at: usize, bytes: usize| {
        let bytes = program.get(at..at + bytes)?;
        Some(bytes.iter().rev().fold(0, |value, &byte| value << 8 | usize::from(byte)))
    };
    let (headers, size, count) = (number(40, 8)?, number(58, 2)?, number(60, 2)?);
    // Its first byte is at address 0 of the table, wherever the program was loaded.
    let base = &raw const PROGRAM as usize;
    let mut found = Vec::new();
    for header in (0..count).map(|index| headers + index * size) {
        if number(header + 4, 4)? != SYMBOL_TABLE {
            continue;
        }
        let (start, length, names) = (number(header + 24, 8)?, number(header + 32, 8)?, number(header + 40, 4)?);
        let names = number(headers + names * size + 24, 8)?;
        for symbol in (start..start + length).step_by(24) {
            let name = program.get(names + number(symbol, 4)?..)?;
            if !name.starts_with(b"{\"package\"") {
                continue;
            }
            let name = name.split(|&byte| byte == 0).next()?;
            found.push(((base + number(symbol + 8, 8)?) as u16, String::from_utf8_lossy(name).into_owned()));
        }
    }
    Some(found)
}
