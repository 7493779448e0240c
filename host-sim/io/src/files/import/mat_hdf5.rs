//! Variables of MATLAB in files of version 7.3, which are HDF5.
//!
//! Names and columns are those of [`mat`](super::mat). HDF5 states sizes in the reverse order, so that the numbers are in the same one.

use hdf5_pure::{AttrValue, Dataset, File, Group};

use super::mat::{Contents, DAMAGED, MAX_DEPTH, MAX_NUMBERS, too_many};

/// First bytes of HDF5, at the beginning or behind MATLAB's 512.
pub const MARK: &[u8] = b"\x89HDF\r\n\x1a\n";

/// Classes of variables that are numbers.
const NUMBERS: [&str; 11] =
    ["double", "single", "logical", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"];

/// Reads the file `bytes`.
pub fn contents(bytes: Vec<u8>) -> Result<Contents, String> {
    let file = File::from_bytes(bytes).map_err(|_| DAMAGED)?;
    let mut contents = Contents::default();
    contents.group(&file.root(), "", 0)?;
    Ok(contents)
}

impl Contents {
    /// Takes the variables in `group`, the fields of the structure `place`.
    fn group(&mut self, group: &Group, place: &str, depth: usize) -> Result<(), String> {
        let named = |name: &str| if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") };
        for name in group.datasets().map_err(|_| DAMAGED)? {
            let dataset = group.dataset(&name).map_err(|_| DAMAGED)?;
            self.dataset(&dataset, named(&name))?;
        }
        // What cells and objects refer to is in groups with such names.
        let groups = group.groups().map_err(|_| DAMAGED)?;
        for name in groups.iter().filter(|name| depth < MAX_DEPTH && !name.starts_with('#')) {
            self.group(&group.group(name).map_err(|_| DAMAGED)?, &named(name), depth + 1)?;
        }
        Ok(())
    }

    fn dataset(&mut self, dataset: &Dataset, name: String) -> Result<(), String> {
        let attributes = dataset.attrs().map_err(|_| DAMAGED)?;
        let class = match attributes.get("MATLAB_class") {
            Some(AttrValue::AsciiString(class) | AttrValue::String(class)) => Some(class.as_str()),
            // A file of HDF5 that is not of MATLAB.
            _ => None,
        };
        match class {
            Some("char" | "cell" | "function_handle") => return Ok(()),
            Some(class) if !NUMBERS.contains(&class) => {
                self.objects.push(name);
                return Ok(());
            }
            _ => {}
        }
        let mut sizes = dataset.shape().map_err(|_| DAMAGED)?;
        // Before room is made for them.
        let count = sizes.iter().try_fold(1_u64, |all, size| all.checked_mul(*size)).ok_or(DAMAGED)?;
        if count > MAX_NUMBERS as u64 {
            return Err(too_many());
        }
        // Complex numbers are pairs, and an empty variable states its sizes as numbers.
        if attributes.contains_key("MATLAB_empty") {
            return Ok(());
        }
        let Ok(values) = dataset.read::<f64>() else {
            self.skipped.push(name);
            return Ok(());
        };
        sizes.reverse();
        let sizes: Vec<f64> = sizes.into_iter().map(|size| size as f64).collect();
        self.take(&name, &sizes, values)
    }
}
