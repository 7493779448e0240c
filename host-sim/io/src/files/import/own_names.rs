//! Columns that have the names of this tool.

use super::chosen::{By, Chosen};
use super::names::Title;
use super::{Names, Quantity, Request, units};

/// The columns that have the names of this tool, where they are all that is needed. No other column counts then.
/// Two columns of one kind are an error.
pub fn own(titles: &[Title], request: &Request<'_>) -> Result<Option<Vec<Chosen>>, String> {
    let mut found: Vec<Chosen> = Vec::new();
    for (index, title) in titles.iter().enumerate().filter(|(_, title)| title.unit.is_none()) {
        let of_title = |(quantity, names): &(Quantity, &Names)| {
            names.iter().find(|(name, _)| *name == title.name).map(|(_, unit)| (*quantity, *unit))
        };
        let Some((quantity, unit)) = request.wanted.iter().find_map(of_title) else { continue };
        if let Some(other) = found.iter().find(|column| column.quantity == quantity) {
            let (one, two) = (other.index + 1, index + 1);
            return Err(format!(
                "columns {one} and {two} are both the {quantity}, {:?} and {:?}; choose one with `columns` {quantity}={one} or \
                 {quantity}={two}",
                titles[other.index].name, title.name
            ));
        }
        let factor = units::read(unit, false).map_or(1.0, |unit| unit.factor);
        found.push(Chosen { quantity, index, unit: unit.into(), factor, by: By::OwnName });
    }
    let has = |quantity: &Quantity| found.iter().any(|column| column.quantity == *quantity);
    let complete = request.needed.iter().all(|set| set.iter().any(has));
    found.sort_by_key(|column| column.quantity);
    Ok(complete.then_some(found))
}

/// Whether there is a displacement as this tool names it, but in another unit, and no other one is `found`.
pub fn has_another_displacement(titles: &[Title], request: &Request<'_>, found: &[Chosen]) -> bool {
    request.wants(Quantity::Displacement)
        && found.iter().all(|column| column.quantity != Quantity::Displacement)
        && titles.iter().any(|title| title.name.starts_with("displacement_"))
}
