//! Files of a release that are made from others: archives, and images of the flash. Their bytes depend on nothing else.

use std::fs::{self, File};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use crc::{CRC_32_JAMCRC, Crc};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::process::{Result, at, entries};

/// Packs `folder`, sorted by names, with the same date and permissions for all files.
pub fn archive(folder: &Path, to: &Path) -> Result<()> {
    let mut files = Vec::new();
    list(folder, &mut files)?;
    files.sort();
    let parent = folder.parent().unwrap_or(folder);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let mut packed = ZipWriter::new(File::create(to).map_err(at(to))?);
    for path in files {
        let parts = path.strip_prefix(parent).map_err(at(&path))?.iter().map(|part| part.to_string_lossy());
        packed.start_file(parts.collect::<Vec<_>>().join("/"), options).map_err(at(&path))?;
        let mut bytes = Vec::new();
        File::open(&path).and_then(|mut file| file.read_to_end(&mut bytes)).map_err(at(&path))?;
        packed.write_all(&bytes).map_err(at(&path))?;
    }
    packed.finish().map(drop).map_err(at(to))
}

fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for path in entries(folder)? {
        if path.is_dir() { list(&path, files)? } else { files.push(path) }
    }
    Ok(())
}

/// Writes the image of the firmware as `to`.elf, its flash as `to`.bin, and for the chip's own loader as `to`.dfu.
pub fn images(elf: &Path, to: &Path) -> Result<()> {
    let bytes = fs::read(elf).map_err(at(elf))?;
    let parts = flash(&bytes).ok_or_else(|| format!("{}: not an image of a chip", elf.display()))?;
    for (end, bytes) in [("elf", bytes.clone()), ("bin", binary(&parts)), ("dfu", dfu(&parts))] {
        let to = to.with_extension(end);
        fs::write(&to, bytes).map_err(at(&to))?;
    }
    Ok(())
}

/// A part of the flash: its address, and what it holds.
type Part = (u32, Vec<u8>);

/// An erased byte of flash.
const ERASED: u8 = 0xFF;

/// The parts of the flash that an ELF of 32 bits loads, sorted by addresses, by its program headers.
fn flash(elf: &[u8]) -> Option<Vec<Part>> {
    let word = |at: usize| Some(u32::from_le_bytes(elf.get(at..at + 4)?.try_into().ok()?));
    let half = |at: usize| Some(usize::from(u16::from_le_bytes(elf.get(at..at + 2)?.try_into().ok()?)));
    elf.starts_with(b"\x7fELF\x01\x01").then_some(())?;
    let (first, size, number) = (word(28)? as usize, half(42)?, half(44)?);
    let mut parts: Vec<Part> = Vec::new();
    for header in (0..number).map(|k| first + k * size) {
        let [kind, offset, _, address, length] = [0, 4, 8, 12, 16].map(|field| word(header + field));
        let (offset, length) = (offset? as usize, length? as usize);
        if kind? == 1 && length > 0 {
            parts.push((address?, elf.get(offset..offset + length)?.to_vec()));
        }
    }
    parts.sort();
    // What follows within a word's alignment is one part.
    let mut joined: Vec<Part> = Vec::new();
    for (address, bytes) in parts {
        match joined.last_mut() {
            Some((start, last)) if address.checked_sub(*start)? as usize <= last.len() + 16 => {
                last.resize((address - *start) as usize, ERASED);
                last.extend(bytes);
            }
            _ => joined.push((address, bytes)),
        }
    }
    (!joined.is_empty()).then_some(joined)
}

/// The flash from its first byte to its last, erased between the parts.
fn binary(parts: &[Part]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (address, part) in parts {
        bytes.resize((address - parts[0].0) as usize, ERASED);
        bytes.extend(part);
    }
    bytes
}

/// The parts as a DfuSe file (ST, UM0391) for the loader in the chip: what lies between them stays as it is.
fn dfu(parts: &[Part]) -> Vec<u8> {
    const TARGET: &[u8] = b"springpot";
    let elements: usize = parts.iter().map(|(_, bytes)| 8 + bytes.len()).sum();
    let mut file = b"DfuSe\x01".to_vec();
    let number = |file: &mut Vec<u8>, number: usize| file.extend((number as u32).to_le_bytes());
    number(&mut file, 11 + 274 + elements);
    file.extend(b"\x01Target\x00\x01\0\0\0");
    file.extend(TARGET.iter().chain(&[0; 255 - TARGET.len()]));
    number(&mut file, elements);
    number(&mut file, parts.len());
    for (address, bytes) in parts {
        file.extend(address.to_le_bytes());
        number(&mut file, bytes.len());
        file.extend(bytes);
    }
    // Any version of ST's loader (0483:df11), and the length of this suffix.
    file.extend(b"\xff\xff\x11\xdf\x83\x04\x1a\x01UFD\x10");
    let sum = Crc::<u32>::new(&CRC_32_JAMCRC).checksum(&file);
    file.extend(sum.to_le_bytes());
    file
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use super::*;

    /// An image with a vector table at 0x0800_0000, and a program with its initial values, which follow after two bytes, at 0x0800_0020.
    fn image() -> Vec<u8> {
        let mut elf = b"\x7fELF\x01\x01".to_vec();
        elf.resize(52, 0);
        elf[28..32].copy_from_slice(&52_u32.to_le_bytes());
        elf[42..46].copy_from_slice(&[32, 0, 4, 0]);
        // Kind, place in the file, address in RAM, address in the flash, length. The last is not loaded.
        let data = 52 + 4 * 32;
        for header in [
            [1, data + 4, 0, 0x0800_0020, 2],
            [1, data, 0, 0x0800_0000, 4],
            [1, data + 6, 0x2000_0000, 0x0800_0024, 1],
            [0x6474_E551, 0, 0, 0, 4],
        ] {
            elf.extend(header.iter().flat_map(|word: &u32| word.to_le_bytes()));
            elf.resize(elf.len() + 12, 0);
        }
        elf.extend([1, 2, 3, 4, 5, 6, 7]);
        elf
    }

    #[test]
    fn an_image_is_its_flash() {
        let parts = flash(&image()).expect("an image");
        let program = vec![5, 6, ERASED, ERASED, 7];
        assert_eq!(parts, [(0x0800_0000, vec![1, 2, 3, 4]), (0x0800_0020, program.clone())]);
        let whole = binary(&parts);
        assert_eq!((&whole[..4], &whole[32..]), ([1, 2, 3, 4].as_slice(), program.as_slice()));
        assert!(whole[4..32].iter().all(|byte| *byte == ERASED));
        for end in 0..image().len() {
            // Cut off anywhere: refused, or the parts that are whole.
            assert_ne!(flash(&image()[..end]).as_ref(), Some(&parts), "{end}");
        }
    }

    /// Sizes and places as ST's UM0391 has them; the checksum leaves the well-known remainder.
    #[test]
    fn a_dfu_file_is_as_described() {
        let file = dfu(&flash(&image()).expect("an image"));
        assert_eq!(file.len(), 11 + 274 + (8 + 4) + (8 + 5) + 16);
        assert_eq!(file[6..10], (file.len() as u32 - 16).to_le_bytes());
        assert_eq!(file[11 + 274 - 8..11 + 274], [25, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(file[285..297], [0, 0, 0, 8, 4, 0, 0, 0, 1, 2, 3, 4]);
        assert_eq!(file[file.len() - 8..file.len() - 4], *b"UFD\x10");
        // Bit by bit.
        let remainder = file.iter().fold(u32::MAX, |sum, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xEDB8_8320 } else { 0 })
        });
        assert_eq!(remainder, 0);
    }

    /// Neither the order in which files were written nor their dates show in an archive.
    #[test]
    fn an_archive_depends_on_its_files_alone() {
        let folder = std::env::temp_dir().join(format!("springpot-archive-{}", std::process::id()));
        let packed = ["one", "other"].map(|copy| {
            let files = folder.join(copy).join("library");
            fs::create_dir_all(files.join("src")).expect("a folder");
            let mut names = ["src/b.c", "a.txt", "src/a.c"];
            let mut date = SystemTime::now();
            if copy == "other" {
                names.reverse();
                date -= Duration::from_secs(100_000_000);
            }
            for name in names {
                fs::write(files.join(name), name).expect("a file");
                File::options()
                    .append(true)
                    .open(files.join(name))
                    .and_then(|file| file.set_modified(date))
                    .expect("a date");
            }
            let to = folder.join(copy).join("library.zip");
            archive(&files, &to).expect("an archive");
            fs::read(to).expect("bytes")
        });
        let mut read = zip::ZipArchive::new(std::io::Cursor::new(&packed[0])).expect("an archive");
        let names: Vec<String> =
            (0..read.len()).map(|k| read.by_index(k).expect("a file").name().expect("text").into_owned()).collect();
        fs::remove_dir_all(&folder).expect("gone");
        assert_eq!(packed[0], packed[1]);
        assert_eq!(names, ["library/a.txt", "library/src/a.c", "library/src/b.c"]);
    }
}
