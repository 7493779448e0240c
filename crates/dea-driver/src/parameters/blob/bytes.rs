//! The bytes of a blob: header, contents, checksum.

use core::ops::Range;

use super::{BLOB_LEN, Blob, BlobError, SCHEMA, SCHEMA_WITHOUT_SPRING};
use crate::chips::Converters;
use crate::parameters::{ControllerMemory, Parameters, SelfSensor};

const MAGIC: [u8; 4] = *b"DEA\x01";
const CHECKSUM_LEN: usize = 4;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The version of blobs with a spring beside the memory.
const SCHEMA_OF_SPRING_BESIDE: u16 = 5;
/// The sizes of a law that a blob does not state.
const USUAL_SIZES: [u8; 3] = [12, 12, 24];
/// Set in the schema's high byte where the contents begin with the sizes of the law.
const STATES_SIZES: u8 = 1;
/// Set there where the contents end with the voltage above which a self-test is needed. Firmware that does not know it refuses the blob.
const STATES_SELF_TEST: u8 = 2;
/// Set where learned changes of the film follow.
const STATES_ADAPTED: u8 = 4;

/// Set where self-sensing follows.
const STATES_SELF_SENSING: u8 = 8;

/// The header of a blob: the bytes before its contents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlobHeader {
    /// The version of the format.
    pub schema: u16,
    /// The board that it is for.
    pub board: u16,
    /// Length of the contents, bytes.
    pub length: u16,
}

impl BlobHeader {
    /// Bytes of a header.
    pub const LEN: usize = 10;

    /// Reads the header at the start of `bytes`. Nothing but the magic is checked.
    ///
    /// # Errors
    ///
    /// [`BlobError::Truncated`], [`BlobError::Magic`].
    pub fn read(bytes: &[u8]) -> Result<Self, BlobError> {
        let &[m0, m1, m2, m3, s0, s1, b0, b1, l0, l1] = bytes.first_chunk().ok_or(BlobError::Truncated)?;
        if [m0, m1, m2, m3] != MAGIC {
            return Err(BlobError::Magic);
        }
        let [schema, board, length] = [[s0, s1], [b0, b1], [l0, l1]].map(u16::from_le_bytes);
        Ok(Self { schema, board, length })
    }

    /// The checksum that the blob of `bytes` would have without one of its parts, and its flag.
    #[inline(never)]
    fn checksum_without(self, bytes: &[u8], flag: u8, part: Range<usize>) -> u32 {
        #[allow(clippy::cast_possible_truncation)] // a part of the length
        let length = self.length - part.len() as u16;
        let header = Self { schema: self.schema & !(u16::from(flag) << 8), length, ..self };
        let mut digest = CRC.digest();
        for kept in [&header.bytes(), &bytes[Self::LEN..part.start], &bytes[part.end..self.contents_end()]] {
            digest.update(kept);
        }
        digest.finalize()
    }

    fn bytes(self) -> [u8; Self::LEN] {
        let [m0, m1, m2, m3] = MAGIC;
        let [[s0, s1], [b0, b1], [l0, l1]] = [self.schema, self.board, self.length].map(u16::to_le_bytes);
        [m0, m1, m2, m3, s0, s1, b0, b1, l0, l1]
    }

    fn contents_end(self) -> usize {
        Self::LEN + usize::from(self.length)
    }
}

impl<M: ControllerMemory> Parameters<M> {
    /// The sizes of the law, and whether a blob has to state them.
    fn sizes() -> Result<([u8; 3], bool), BlobError> {
        let [head, fast, slow] = M::SIZES.map(u8::try_from);
        // More than 255 weights do not fit in a blob.
        let (Ok(head), Ok(fast), Ok(slow)) = (head, fast, slow) else { return Err(BlobError::TooLong) };
        let sizes = [head, fast, slow];
        Ok((sizes, sizes != USUAL_SIZES))
    }

    /// Writes the blob for `board`, with [its converters](Converters::of_board), to `bytes` and returns its length.
    ///
    /// # Errors
    ///
    /// [`BlobError`] for parameters that a controller would refuse, and for less room than the blob takes.
    pub fn encode(&self, board: u16, bytes: &mut [u8]) -> Result<usize, BlobError> {
        self.encode_for(board, &Converters::of_board(board), bytes)
    }

    /// The same for a board with other `converters`.
    #[allow(clippy::missing_errors_doc)] // as the one above
    pub fn encode_for(&self, board: u16, converters: &Converters, bytes: &mut [u8]) -> Result<usize, BlobError> {
        Blob::with_converters(self.clone(), converters)?;
        let (sizes, stated) = Self::sizes()?;
        let room = bytes.len().min(BLOB_LEN);
        let body = bytes.get_mut(BlobHeader::LEN..room).ok_or(BlobError::TooLong)?;
        let written = if stated { postcard::to_slice(&(sizes, self), body) } else { postcard::to_slice(self, body) };
        let mut written = written.map_err(|_| BlobError::TooLong)?.len();
        let mut flags = if stated { STATES_SIZES } else { 0 };
        if self.self_test_above_v < Self::NO_SELF_TEST_V {
            let above_v = self.self_test_above_v.to_le_bytes();
            body.get_mut(written..written + above_v.len()).ok_or(BlobError::TooLong)?.copy_from_slice(&above_v);
            (written, flags) = (written + above_v.len(), flags | STATES_SELF_TEST);
        }
        if let Some(adapted) = &self.adapted {
            let room = body.get_mut(written..).ok_or(BlobError::TooLong)?;
            written += postcard::to_slice(adapted, room).map_err(|_| BlobError::TooLong)?.len();
            flags |= STATES_ADAPTED;
        }
        if let Some(sensor) = &self.self_sensing {
            let room = body.get_mut(written..).ok_or(BlobError::TooLong)?;
            written += postcard::to_slice(sensor, room).map_err(|_| BlobError::TooLong)?.len();
            flags |= STATES_SELF_SENSING;
        }
        let length = u16::try_from(written).map_err(|_| BlobError::TooLong)?;
        let schema = match M::springs(&self.law) {
            [_, true] => SCHEMA,
            [true, false] => SCHEMA_OF_SPRING_BESIDE,
            [false, false] => SCHEMA_WITHOUT_SPRING,
        };
        let schema = schema | u16::from(flags) << 8;
        let header = BlobHeader { schema, board, length };
        let end = header.contents_end();
        bytes[..BlobHeader::LEN].copy_from_slice(&header.bytes());
        let checksum = CRC.checksum(&bytes[..end]).to_le_bytes();
        bytes.get_mut(end..end + CHECKSUM_LEN).ok_or(BlobError::TooLong)?.copy_from_slice(&checksum);
        Ok(end + CHECKSUM_LEN)
    }
}

impl Blob {
    /// Reads and checks the blob at the start of `bytes`, which must be for `board`, with
    /// [its converters](Converters::of_board).
    ///
    /// # Errors
    ///
    /// [`BlobError`] for the first thing that is wrong.
    pub fn decode(bytes: &[u8], board: u16) -> Result<Self, BlobError> {
        Self::decode_for(bytes, board, &Converters::of_board(board))
    }
}

impl<M: ControllerMemory> Blob<M> {
    /// The same for a board with other `converters`, or a law with another memory.
    #[allow(clippy::missing_errors_doc)] // as the one above
    pub fn decode_for(bytes: &[u8], board: u16, converters: &Converters) -> Result<Self, BlobError> {
        let header = BlobHeader::read(bytes)?;
        let end = header.contents_end();
        if end + CHECKSUM_LEN > BLOB_LEN {
            return Err(BlobError::TooLong);
        }
        let found = bytes.get(end..end + CHECKSUM_LEN).ok_or(BlobError::Truncated)?;
        let mut checksum = CRC.checksum(&bytes[..end]);
        if checksum.to_le_bytes() != found {
            return Err(BlobError::Checksum);
        }
        // The bytes are as they were written.
        let [schema, flags] = header.schema.to_le_bytes();
        if !(SCHEMA_WITHOUT_SPRING..=SCHEMA).contains(&u16::from(schema))
            || flags & !(STATES_SIZES | STATES_SELF_TEST | STATES_ADAPTED | STATES_SELF_SENSING) != 0
        {
            return Err(BlobError::Schema { found: header.schema });
        }
        if header.board != board {
            return Err(BlobError::Board { found: header.board });
        }
        let contents = &bytes[BlobHeader::LEN..end];
        let (found, contents) = if flags & STATES_SIZES == 0 {
            (USUAL_SIZES, contents)
        } else {
            contents.split_first_chunk().map(|(&sizes, rest)| (sizes, rest)).ok_or(BlobError::Contents)?
        };
        let (expected, _) = Parameters::<M>::sizes()?;
        if found != expected {
            return Err(BlobError::LawSizes { found, expected });
        }
        let refused = |_| BlobError::Contents;
        let (mut parameters, mut rest) = postcard::take_from_bytes::<Parameters<M>>(contents).map_err(refused)?;
        parameters.self_test_above_v = Parameters::<M>::NO_SELF_TEST_V;
        if flags & STATES_SELF_TEST != 0 {
            (parameters.self_test_above_v, rest) = postcard::take_from_bytes(rest).map_err(refused)?;
        }
        if flags & STATES_ADAPTED != 0 {
            let (adapted, left) = postcard::take_from_bytes(rest).map_err(refused)?;
            checksum = header.checksum_without(bytes, STATES_ADAPTED, end - rest.len()..end - left.len());
            (parameters.adapted, rest) = (Some(adapted), left);
        }
        if flags & STATES_SELF_SENSING != 0 {
            rest = SelfSensor::take(&mut parameters.self_sensing, rest)?;
        }
        if !rest.is_empty() {
            return Err(BlobError::Contents);
        }
        Ok(Self { checksum: Some(checksum), ..Self::with_converters(parameters, converters)? })
    }
}
