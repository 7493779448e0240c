//! Kinds of files, by their first bytes.

use super::{mat, mat_hdf5};

/// Kind of a file that is read here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Text in some encoding.
    Text,
    /// A workbook of spreadsheets (.xlsx).
    Workbook,
    /// Variables of MATLAB, version 5 to 7 (.mat).
    Mat,
    /// Variables of MATLAB, version 4.
    OldMat,
    /// Variables of MATLAB, version 7.3.
    MatHdf5,
}

/// First bytes of files that are not read, what they are, and what to do.
const REFUSED: &[(&[u8], &str)] = &[
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "this is a spreadsheet of the old format (.xls); save it as .xlsx or as CSV"),
    (b"# Created by Octave", "this is text of Octave's `save`; write it with `save -v7`, or csvwrite and a header"),
    (b"TDSm", "this is a LabVIEW measurement (TDMS); export it as text or .xlsx"),
    (b"PAR1", "this is a Parquet file; export it as CSV"),
    (b"\x93NUMPY", "this is a NumPy array; write it with numpy.savetxt and a header, or scipy.io.savemat"),
    (b"SQLite format 3\0", "this is a database; export a table of it as CSV"),
    (b"%PDF", "this is a PDF document; export the measurement as CSV"),
    (b"\x1f\x8b", "this is compressed (gzip); unpack it first"),
    (b"BZh", "this is compressed (bzip2); unpack it first"),
    (b"\xfd7zXZ", "this is compressed (xz); unpack it first"),
    (b"7z\xbc\xaf", "this is a 7-Zip archive; unpack it first"),
    (b"Rar!", "this is an archive (RAR); unpack it first"),
    (b"\x89PNG", "this is a picture; name the file of the numbers"),
    (b"\xff\xd8\xff", "this is a picture; name the file of the numbers"),
    (b"\x7fELF", "this is a program; name the file of the numbers"),
];

/// The kind of a file that begins with `head`.
/// Any other kind is an error, which names it.
pub fn detect(head: &[u8]) -> Result<Kind, String> {
    if head.is_empty() {
        return Err(
            "is empty; there must be a header, such as time_s,voltage_v,displacement_m of a recording, and rows of numbers".into()
        );
    }
    if let Some((_, cause)) = REFUSED.iter().find(|(mark, _)| head.starts_with(mark)) {
        return Err((*cause).into());
    }
    if [0, 512].iter().any(|at| head.get(*at..).is_some_and(|rest| rest.starts_with(mat_hdf5::MARK))) {
        return Ok(Kind::MatHdf5);
    }
    if head.starts_with(b"PK\x03\x04") {
        return Ok(Kind::Workbook);
    }
    if head.len() >= 128 && matches!(&head[126..128], b"IM" | b"MI") && head.starts_with(b"MATLAB") {
        return Ok(Kind::Mat);
    }
    if mat::is_version_4(head) {
        return Ok(Kind::OldMat);
    }
    let text = head.trim_ascii_start();
    if text.starts_with(b"<?xml") || text.to_ascii_lowercase().starts_with(b"<!doctype") || text.starts_with(b"<html") {
        return Err("this is a page or a document (XML, HTML); export the measurement as CSV".into());
    }
    if text.first() == Some(&b'{') {
        return Err("this is a JSON document; write its series as columns of a CSV file".into());
    }
    Ok(Kind::Text)
}
