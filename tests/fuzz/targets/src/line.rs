//! Frames as dea-driver/doc/link.md has them, written a second time: sealed and read without the driver's code.

/// Most bytes of a frame without its closing zero.
const MAX_FRAME: usize = 360;

/// The version of the protocol.
const VERSION: u8 = 7;

/// CRC-32 (ISO-HDLC), bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// The frame of a postcard `message`, with its closing zero: whole, whatever the message is.
pub fn seal(message: &[u8]) -> Vec<u8> {
    let mut plain = [&[VERSION], message].concat();
    plain.extend(crc32(&plain).to_le_bytes());
    let mut stuffed = Vec::new();
    for piece in plain.split(|&byte| byte == 0) {
        // A zero is where one piece ends and the next begins, but no zero follows a full group: an empty one comes between.
        let mut rest = piece;
        while let Some((full, later)) = rest.split_at_checked(254) {
            stuffed.push(0xff);
            stuffed.extend(full);
            rest = later;
        }
        stuffed.push(rest.len() as u8 + 1);
        stuffed.extend(rest);
    }
    stuffed.push(0);
    stuffed
}

/// Kind of a frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Received {
    /// Damaged, or too long.
    Damaged,
    /// Whole, but of another version, or not a request.
    Unknown,
    /// A request.
    Request(Heading),
}

/// The start of a request.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heading {
    /// Its number.
    pub sequence: u32,
    /// The token of the host that armed.
    pub token: u16,
    /// The number of the command.
    pub command: u32,
    /// The mode of `Start`, the first byte behind the command.
    pub first: u8,
}

/// The other end of a line: collects bytes into frames.
#[derive(Default)]
pub struct Rx {
    bytes: Vec<u8>,
}

impl Rx {
    /// Takes a byte; at the end of a frame, says what it was.
    pub fn receive(&mut self, byte: u8) -> Option<Received> {
        if byte != 0 {
            self.bytes.push(byte);
            return None;
        }
        let stuffed = std::mem::take(&mut self.bytes);
        if stuffed.is_empty() { None } else { Some(read(&stuffed)) }
    }
}

fn read(stuffed: &[u8]) -> Received {
    let plain = if stuffed.len() > MAX_FRAME { None } else { unstuffed(stuffed) };
    let Some((body, checksum)) = plain.as_deref().and_then(<[u8]>::split_last_chunk::<4>) else {
        return Received::Damaged;
    };
    match body {
        [] => Received::Damaged,
        _ if crc32(body).to_le_bytes() != *checksum => Received::Damaged,
        [VERSION, message @ ..] => request(message).map_or(Received::Unknown, Received::Request),
        _ => Received::Unknown,
    }
}

/// COBS: a group's first byte is its length, and there was a zero behind it unless it is the last, or full.
fn unstuffed(stuffed: &[u8]) -> Option<Vec<u8>> {
    let mut plain = Vec::new();
    let mut rest = stuffed;
    while let Some((&length, behind)) = rest.split_first() {
        let (group, later) = behind.split_at_checked(usize::from(length).checked_sub(1)?)?;
        plain.extend(group);
        if length != 0xff && !later.is_empty() {
            plain.push(0);
        }
        rest = later;
    }
    Some(plain)
}

/// The heading of a request, if all of it is one: the table of dea-driver/doc/link.md.
fn request(message: &[u8]) -> Option<Heading> {
    let mut rest = message;
    let take = &mut rest;
    let sequence = u32::try_from(varint(take, 5)?).ok()?;
    let token = u16::try_from(varint(take, 3)?).ok()?;
    let command = u32::try_from(varint(take, 5)?).ok()?;
    let first = take.first().copied().unwrap_or(0);
    match command {
        0..=3 | 5..=7 | 12 | 14 | 17 | 20..=22 | 26 | 27 => {}
        4 => mode(take)?,
        8 | 9 => skip(take, 4)?,
        10 => {
            u16::try_from(varint(take, 3)?).ok()?;
            let length = at_most(take, 128)?;
            skip(take, length)?;
        }
        11 | 13 | 16 | 25 => drop(u16::try_from(varint(take, 3)?).ok()?),
        15 => {
            let steps = at_most(take, 24)?;
            skip(take, 4 * steps)?;
        }
        18 => drop(varint(take, 5).filter(|&fault| fault < 7)?),
        19 => {
            mode(take)?;
            for _ in 0..at_most(take, 24)? {
                skip(take, 4)?;
                let sample = *take.split_off_first()?;
                skip(take, [0, 4].get(usize::from(sample)).copied()?)?;
            }
        }
        24 => drop(varint(take, 5).filter(|&order| order < 2)?),
        23 => {
            mode(take)?;
            for _ in 0..at_most(take, 24)? {
                take.split_off_first().filter(|&&closed| closed < 2)?;
                u16::try_from(varint(take, 3)?).ok()?;
                u16::try_from(varint(take, 3)?).ok()?;
                skip(take, 4)?;
            }
        }
        _ => return None,
    }
    take.is_empty().then_some(Heading { sequence, token, command, first })
}

fn mode(rest: &mut &[u8]) -> Option<()> {
    varint(rest, 5).filter(|&mode| mode < 3).map(drop)
}

fn at_most(rest: &mut &[u8], most: u64) -> Option<usize> {
    varint(rest, 10).filter(|&length| length <= most).map(|length| length as usize)
}

fn skip(rest: &mut &[u8], length: usize) -> Option<()> {
    rest.split_off(..length).map(drop)
}

/// Seven bits to a byte, the lowest first; set where another byte follows.
fn varint(rest: &mut &[u8], longest: usize) -> Option<u64> {
    let mut value = 0u128;
    for index in 0..longest {
        let byte = *rest.split_off_first()?;
        value |= u128::from(byte & 0x7f) << (7 * index);
        if byte & 0x80 == 0 {
            // The last byte holds what is left of 16, 32 or 64 bits.
            let bits = match longest {
                3 => 16,
                5 => 32,
                _ => 64,
            };
            return if value >> bits == 0 { u64::try_from(value).ok() } else { None };
        }
    }
    None
}
