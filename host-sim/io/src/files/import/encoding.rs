//! Text in the encodings of other programs.

use encoding_rs::{Encoding, GBK, SHIFT_JIS, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// The text of a file in one encoding.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// Name of the encoding.
    pub encoding: &'static str,
    /// The text, without a byte order mark.
    pub text: String,
}

/// The texts that `bytes` may be: one, or several where no mark and no rule of an encoding separates them.
pub fn readings(bytes: &[u8]) -> Result<Vec<Decoded>, String> {
    if bytes.starts_with(b"\xff\xfe\0\0") || bytes.starts_with(b"\0\0\xfe\xff") {
        return Err("is UTF-32 text; save it as UTF-8".into());
    }
    if let Some((encoding, mark)) = Encoding::for_bom(bytes) {
        return Ok(vec![decoded(encoding, &bytes[mark..]).ok_or_else(|| {
            format!("begins as {} text and is not that throughout; save it as UTF-8", shown(encoding))
        })?]);
    }
    if let Some(encoding) = utf_16_without_mark(bytes) {
        return Ok(vec![decoded(encoding, bytes).ok_or("is half UTF-16 text; save it as UTF-8")?]);
    }
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count();
        return Err(format!(
            "not text: it contains null bytes, the first in line {line}; remove what is damaged, or name the file that holds the numbers"
        ));
    }
    if let Some(text) = decoded(UTF_8, bytes) {
        return Ok(vec![text]);
    }
    let found: Vec<Decoded> =
        [SHIFT_JIS, GBK, WINDOWS_1252].into_iter().filter_map(|encoding| decoded(encoding, bytes)).collect();
    if found.is_empty() { Err("is text in no encoding that is known here; save it as UTF-8".into()) } else { Ok(found) }
}

/// Length of a text without zero bytes that are at its end alone.
pub fn without_zeros(bytes: &[u8]) -> usize {
    let length = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    if bytes[..length].contains(&0) { bytes.len() } else { length }
}

fn decoded(encoding: &'static Encoding, bytes: &[u8]) -> Option<Decoded> {
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes)?;
    // DOS ends texts with a sign of its own, and files that were joined have a mark in the middle.
    Some(Decoded { encoding: shown(encoding), text: text.trim_end_matches('\u{1a}').replace('\u{feff}', "") })
}

fn shown(encoding: &'static Encoding) -> &'static str {
    // As programs call it that write it.
    if encoding == WINDOWS_1252 { "Latin-1" } else { encoding.name() }
}

/// UTF-16 text of mostly Latin letters has a zero in every other byte.
fn utf_16_without_mark(bytes: &[u8]) -> Option<&'static Encoding> {
    const SAMPLE: usize = 4096;
    let sample = &bytes[..bytes.len().min(SAMPLE) & !1];
    if sample.len() < 8 {
        return None;
    }
    let zeros = |from: usize| sample.iter().skip(from).step_by(2).filter(|byte| **byte == 0).count();
    let (first, second, half) = (zeros(0), zeros(1), sample.len() / 2);
    match (10 * first, 10 * second) {
        (0, many) if many > 8 * half => Some(UTF_16LE),
        (many, 0) if many > 8 * half => Some(UTF_16BE),
        _ => None,
    }
}
