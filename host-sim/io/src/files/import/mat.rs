//! Variables of MATLAB: MAT-files of version 5, which `save -v6` and `-v7` write, and of version 4; those of version 7.3 are in
//! [`mat_hdf5`](super::mat_hdf5).
//!
//! Every series of numbers becomes a column: a vector by its name, the columns of a matrix as `data(:,2)`, fields of structures
//! as `run.voltage`. Compressed variables are inflated. A file is data to judge: every length is checked against what is there.
//! (Of the crates that read these files, one knows no structures, and the other panics on damaged ones.)

use std::io::Read;

use flate2::read::ZlibDecoder;

/// A series of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name, as MATLAB would call it.
    pub name: String,
    /// Its numbers.
    pub values: Vec<f64>,
}

/// Contents of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// Series of at least two numbers.
    pub series: Vec<Series>,
    /// Variables that are objects, such as tables and time series, which only MATLAB can read.
    pub objects: Vec<String>,
    /// Variables whose numbers are complex or sparse.
    pub skipped: Vec<String>,
}

/// Most numbers of a file: a gigabyte as they are held.
pub(super) const MAX_NUMBERS: usize = 1 << 27;
/// Deepest structure in a structure.
pub(super) const MAX_DEPTH: usize = 8;
/// Largest number of columns of a matrix; of rows, where those are fewer.
const MAX_COLUMNS: usize = 64;

/// A file that ends too early, or that is not what it says.
pub(super) const DAMAGED: &str = "a damaged MATLAB file; save it again";

/// Types of elements.
mod element {
    pub const INT8: u32 = 1;
    pub const UINT8: u32 = 2;
    pub const INT16: u32 = 3;
    pub const UINT16: u32 = 4;
    pub const INT32: u32 = 5;
    pub const UINT32: u32 = 6;
    pub const SINGLE: u32 = 7;
    pub const DOUBLE: u32 = 9;
    pub const INT64: u32 = 12;
    pub const UINT64: u32 = 13;
    pub const MATRIX: u32 = 14;
    pub const COMPRESSED: u32 = 15;
}

/// Classes of arrays.
mod class {
    pub const CELL: u8 = 1;
    pub const STRUCTURE: u8 = 2;
    pub const OBJECT: u8 = 3;
    pub const SPARSE: u8 = 5;
    pub const DOUBLE: u8 = 6;
    pub const UINT64: u8 = 15;
    pub const OPAQUE: u8 = 17;
}

/// Reads the file `bytes`.
pub fn contents(bytes: &[u8]) -> Result<Contents, String> {
    let little = match bytes.get(126..128) {
        Some(b"IM") => true,
        Some(b"MI") => false,
        _ => return Err(DAMAGED.into()),
    };
    let mut contents = Contents::default();
    let mut rest = Bytes { bytes: &bytes[128..], little };
    while !rest.bytes.is_empty() {
        let (mut kind, mut data) = rest.element()?;
        let mut inflated = Vec::new();
        if kind == element::COMPRESSED {
            // Eight bytes a number and something for names.
            let limit = 8 * MAX_NUMBERS as u64 + (1 << 20);
            ZlibDecoder::new(data.bytes).take(limit).read_to_end(&mut inflated).map_err(|_| DAMAGED)?;
            if inflated.len() as u64 == limit {
                return Err(too_many());
            }
            (kind, data) = Bytes { bytes: &inflated, little }.element()?;
        }
        if kind == element::MATRIX {
            contents.variable(data, None, 0)?;
        }
    }
    Ok(contents)
}

/// The header of a variable in a file of version 4.
struct OldHeader {
    /// The type of its numbers, as in version 5, and their size.
    kind: u32,
    size: usize,
    /// Whether it is a matrix of numbers, not a text or a sparse matrix.
    is_full: bool,
    rows: usize,
    columns: usize,
    complex: bool,
    name_length: usize,
}

impl OldHeader {
    const LENGTH: usize = 20;

    /// Reads it, and whether the lowest byte of a number comes first.
    fn read(bytes: &[u8]) -> Option<(Self, bool)> {
        [true, false].into_iter().find_map(|little| {
            let mut words = Bytes { bytes: bytes.get(..Self::LENGTH)?, little };
            let mut word = || words.word().ok();
            let (code, rows, columns, complex, name_length) = (word()?, word()?, word()?, word()?, word()?);
            let (kind, size) = match code % 1000 / 10 {
                0 => (element::DOUBLE, 8),
                1 => (element::SINGLE, 4),
                2 => (element::INT32, 4),
                3 => (element::INT16, 2),
                4 => (element::UINT16, 2),
                5 => (element::UINT8, 1),
                _ => return None,
            };
            let order = if little { 0 } else { 1 };
            let is_header = code / 1000 == order && code % 10 < 3 && complex < 2 && (2..=64).contains(&name_length);
            let header = Self {
                kind,
                size,
                is_full: code % 10 == 0,
                rows: rows as usize,
                columns: columns as usize,
                complex: complex == 1,
                name_length: name_length as usize,
            };
            is_header.then_some((header, little))
        })
    }
}

/// Whether a file that begins with `head` is of version 4: it has no mark but the header of its first variable and its name.
pub fn is_version_4(head: &[u8]) -> bool {
    OldHeader::read(head).is_some_and(|(header, _)| {
        let name = head.get(OldHeader::LENGTH..OldHeader::LENGTH + header.name_length);
        name.and_then(<[u8]>::split_last).is_some_and(|(end, name)| *end == 0 && name.iter().all(u8::is_ascii_graphic))
    })
}

/// Reads the file `bytes` of version 4.
pub fn contents_of_version_4(bytes: &[u8]) -> Result<Contents, String> {
    let mut contents = Contents::default();
    let mut rest = bytes;
    while !rest.is_empty() {
        let (header, little) = OldHeader::read(rest).ok_or(DAMAGED)?;
        let mut data = Bytes { bytes: &rest[OldHeader::LENGTH..], little };
        let name = text(data.cut(header.name_length)?);
        let count =
            header.rows.checked_mul(header.columns).filter(|count| *count <= MAX_NUMBERS).ok_or_else(too_many)?;
        let values = Bytes { bytes: data.cut(header.size * count)?, little };
        if header.complex {
            data.cut(header.size * count)?;
            contents.skipped.push(name);
        } else if header.is_full {
            contents.take(&name, &[header.rows as f64, header.columns as f64], values.numbers(header.kind)?)?;
        }
        rest = data.bytes;
    }
    Ok(contents)
}

/// The error about a file of too many numbers.
pub(super) fn too_many() -> String {
    format!("more than {MAX_NUMBERS} numbers; save only what belongs to the recording")
}

impl Contents {
    /// Takes the array `data`; `name` is that of a field, which has none of its own.
    fn variable(&mut self, mut data: Bytes<'_>, name: Option<&str>, depth: usize) -> Result<(), String> {
        if data.bytes.is_empty() {
            return Ok(());
        }
        let (_, mut flags) = data.element()?;
        let flags = flags.word()?;
        let (class, complex) = ((flags & 0xff) as u8, flags & 0x800 != 0);
        if class == class::OPAQUE {
            // Its name is where others have their sizes.
            let own = data.element().map(|(_, own)| text(own.bytes)).unwrap_or_default();
            self.objects.push(name.map_or(own, str::to_owned));
            return Ok(());
        }
        let (_, sizes) = data.element()?;
        let sizes = sizes.numbers(element::INT32)?;
        let count = sizes.iter().try_fold(1_usize, |all, size| all.checked_mul(*size as usize)).ok_or(DAMAGED)?;
        if count > MAX_NUMBERS {
            return Err(too_many());
        }
        let (_, own) = data.element()?;
        let name = name.map_or_else(|| text(own.bytes), str::to_owned);
        match class {
            class::DOUBLE..=class::UINT64 => {
                let (kind, values) = data.element()?;
                let values = values.numbers(kind)?;
                if values.len() != count {
                    return Err(DAMAGED.into());
                }
                if complex {
                    self.skipped.push(name);
                } else {
                    self.take(&name, &sizes, values)?;
                }
            }
            class::SPARSE => self.skipped.push(name),
            class::STRUCTURE => self.structure(data, &name, count, depth)?,
            class::OBJECT => self.objects.push(name),
            class::CELL => {
                for index in 0..count.min(MAX_COLUMNS) {
                    self.part(&mut data, &format!("{name}{{{}}}", index + 1), depth)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes the next array in `data`, a part of a variable, by its `name`.
    fn part(&mut self, data: &mut Bytes<'_>, name: &str, depth: usize) -> Result<(), String> {
        let (_, value) = data.element()?;
        if depth < MAX_DEPTH { self.variable(value, Some(name), depth + 1) } else { Ok(()) }
    }

    /// Takes the fields of `count` structures.
    fn structure(&mut self, mut data: Bytes<'_>, name: &str, count: usize, depth: usize) -> Result<(), String> {
        let (_, mut length) = data.element()?;
        let length = length.word()? as usize;
        let (_, names) = data.element()?;
        if length == 0 {
            return Err(DAMAGED.into());
        }
        let fields: Vec<String> = names.bytes.chunks(length).map(text).collect();
        for index in 0..count.min(MAX_COLUMNS) {
            let place = if count > 1 { format!("{name}({})", index + 1) } else { name.to_owned() };
            for field in &fields {
                self.part(&mut data, &format!("{place}.{field}"), depth)?;
            }
        }
        Ok(())
    }

    /// Takes the columns of an array.
    pub(super) fn take(&mut self, name: &str, sizes: &[f64], values: Vec<f64>) -> Result<(), String> {
        let held: usize = self.series.iter().map(|series| series.values.len()).sum();
        if held + values.len() > MAX_NUMBERS {
            return Err(too_many());
        }
        let rows = sizes.first().map_or(0, |rows| *rows as usize);
        if values.len() < 2 {
            return Ok(());
        }
        // A vector is a row or a column.
        if rows == 1 || rows == values.len() {
            self.series.push(Series { name: name.into(), values });
            return Ok(());
        }
        let columns = values.len() / rows.max(1);
        if rows < columns {
            // Rows for columns.
            for row in 0..rows.min(MAX_COLUMNS) {
                let values = values.iter().skip(row).step_by(rows).copied().collect();
                self.series.push(Series { name: format!("{name}({},:)", row + 1), values });
            }
        } else {
            for (column, values) in values.chunks(rows).take(MAX_COLUMNS).enumerate() {
                self.series.push(Series { name: format!("{name}(:,{})", column + 1), values: values.to_vec() });
            }
        }
        Ok(())
    }
}

/// Bytes of a file that are read from their beginning.
#[derive(Clone, Debug)]
struct Bytes<'a> {
    bytes: &'a [u8],
    little: bool,
}

impl<'a> Bytes<'a> {
    fn cut(&mut self, length: usize) -> Result<&'a [u8], String> {
        let (first, rest) = self.bytes.split_at_checked(length).ok_or(DAMAGED)?;
        self.bytes = rest;
        Ok(first)
    }

    fn word(&mut self) -> Result<u32, String> {
        let bytes: [u8; 4] = self.cut(4)?.try_into().map_err(|_| DAMAGED)?;
        Ok(if self.little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// The next element: its type and its data.
    fn element(&mut self) -> Result<(u32, Self), String> {
        let first = self.word()?;
        let little = self.little;
        if first >> 16 != 0 {
            // A small one: length and type in one word, data in the next.
            let (length, kind) = ((first >> 16) as usize, first & 0xffff);
            let data = self.cut(4)?;
            return Ok((kind, Self { bytes: data.get(..length).ok_or(DAMAGED)?, little }));
        }
        let length = self.word()? as usize;
        let data = self.cut(length)?;
        // All but compressed ones end at a multiple of eight; the last may lack what fills it up.
        if first != element::COMPRESSED {
            let fill = length.next_multiple_of(8) - length;
            let _ = self.cut(fill.min(self.bytes.len()))?;
        }
        Ok((first, Self { bytes: data, little }))
    }

    /// The numbers of an element of type `kind`.
    fn numbers(&self, kind: u32) -> Result<Vec<f64>, String> {
        macro_rules! read {
            ($t:ty) => {{
                const SIZE: usize = size_of::<$t>();
                let number = |bytes: &[u8]| {
                    let mut array = [0; SIZE];
                    array.copy_from_slice(bytes);
                    (if self.little { <$t>::from_le_bytes(array) } else { <$t>::from_be_bytes(array) }) as f64
                };
                self.bytes.chunks_exact(SIZE).map(number).collect()
            }};
        }
        Ok(match kind {
            element::INT8 => read!(i8),
            element::UINT8 => read!(u8),
            element::INT16 => read!(i16),
            element::UINT16 => read!(u16),
            element::INT32 => read!(i32),
            element::UINT32 => read!(u32),
            element::SINGLE => read!(f32),
            element::DOUBLE => read!(f64),
            element::INT64 => read!(i64),
            element::UINT64 => read!(u64),
            _ => return Err(DAMAGED.into()),
        })
    }
}

/// A name that ends with its first zero.
fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
