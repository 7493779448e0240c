//! Which column is what: from the titles, and from what a person chose.
//!
//! Words name a quantity, units confirm it. A column whose words name nothing is taken by its unit alone where that is the only
//! one; a plain voltage is not, because sensors give volts as well. Two columns that may be the same quantity are an error.

use super::choice::{Choice, Choices, Column};
use super::chosen::{By, Chosen};
use super::names::{self, Sense, Title, UnitSense};
use super::times::Origin;
use super::units::{self, Unit};
use super::{Quantity, Request, own_names};

/// The columns with `titles` that `request` asks for; their times are from `times`.
/// What is missing, or may be read in two ways, is an error that says what to give with `--columns`.
pub fn map(titles: &[Title], request: &Request<'_>, choices: &Choices, times: Origin) -> Result<Vec<Chosen>, String> {
    let letters = |test: fn(char) -> bool| titles.iter().any(|title| title.name.chars().any(test));
    let capitals = letters(char::is_uppercase) && !letters(char::is_lowercase);
    let senses = titles.iter().map(|title| title.sense(request, capitals)).collect();
    let titles = Titles { titles, senses, times };
    // A log in another dialect.
    let is_whole = |found: &[Chosen]| {
        found.iter().any(|column| column.quantity == Quantity::Displacement) || !request.wants(Quantity::Displacement)
    };
    if choices.is_empty()
        && times != Origin::Person
        && let Some(found) = own_names::own(titles.titles, request)?.filter(|found| is_whole(found))
    {
        return Ok(found.into_iter().map(|column| Chosen { by: By::Name, ..column }).collect());
    }
    let other = |quantity: &Quantity| !request.wants(*quantity) && choices.get(*quantity).is_some();
    if let Some(other) = [Quantity::Command, Quantity::Stretch, Quantity::Stress].iter().find(|q| other(q)) {
        let names: Vec<&str> = request.wanted.iter().map(|(quantity, _)| quantity.name()).collect();
        return Err(format!("`columns` {other}: what is read here is {}", names.join(", ")));
    }
    let mut chosen: Vec<Chosen> = Vec::new();
    for (quantity, _) in request.wanted {
        if let Some(choice) = choices.get(*quantity) {
            chosen.extend(titles.chosen(choice)?);
        }
    }
    titles.refuse_doubles(&chosen)?;
    let wanted = request.wanted.iter().map(|(quantity, _)| *quantity);
    let is_sought = |quantity: &Quantity| {
        choices.get(*quantity).is_none() && !(*quantity == Quantity::Time && times == Origin::Person)
    };
    let mut missing = Vec::new();
    for quantity in wanted.filter(is_sought) {
        let taken: Vec<usize> = chosen.iter().map(|column| column.index).collect();
        match titles.named(quantity, &taken)? {
            Some(column) => chosen.push(column),
            None => missing.push(quantity),
        }
    }
    // The unit alone counts for what is needed, and for voltage and displacement, which most recordings have.
    for quantity in missing {
        let has = |wanted: Quantity| chosen.iter().any(|column| column.quantity == wanted);
        let needed = request.needed.iter().any(|set| set.contains(&quantity) && !set.iter().any(|q| has(*q)));
        // A voltage drives the film, also beside a force.
        let is_sought = needed || matches!(quantity, Quantity::Voltage | Quantity::Displacement);
        let taken: Vec<usize> = chosen.iter().map(|column| column.index).collect();
        let by_unit = titles.of_unit(quantity, &taken, false);
        match by_unit.as_slice() {
            [] => titles.refuse_other_unit(quantity, &taken, is_sought)?,
            candidates if is_sought => chosen.push(titles.one_of(quantity, candidates, By::Unit)?),
            _ => {}
        }
    }
    titles.refuse_force_beside_volts(&chosen, choices, request)?;
    for set in request.needed {
        let is_time = *set == [Quantity::Time];
        if !(is_time && times != Origin::Column || chosen.iter().any(|column| set.contains(&column.quantity))) {
            return Err(titles.missing(set, request));
        }
    }
    chosen.sort_by_key(|column| column.quantity);
    Ok(chosen)
}

/// Units of electric fields.
const FIELDS: [&str; 6] = ["V/m", "V/µm", "V/um", "V/mm", "V/mil", "V/cm"];

/// Most columns that an error lists.
const MAX_SHOWN: usize = 8;

struct Titles<'a> {
    titles: &'a [Title],
    senses: Vec<Sense>,
    times: Origin,
}

impl Titles<'_> {
    /// The column that a person chose.
    fn chosen(&self, choice: &Choice) -> Result<Option<Chosen>, String> {
        let quantity = choice.quantity;
        let index = match &choice.column {
            None => return Ok(None),
            Some(Column::Number(number)) if *number <= self.titles.len() => number - 1,
            Some(Column::Number(number)) => {
                return Err(format!("`columns` {quantity}={number}: there are {} columns", self.titles.len()));
            }
            Some(Column::Name(name)) => self.by_name(quantity, name)?,
        };
        if quantity == Quantity::Temperature && choice.factor.is_none() && names::is_no_celsius(&self.titles[index]) {
            return Err(format!(
                "`columns` temperature: column {} is not in °C by its title; convert it, or temperature={}*1 if it is in °C",
                self.shown(index),
                index + 1
            ));
        }
        let known = match self.senses[index].unit {
            UnitSense::Known(unit) if unit.quantity == quantity.measure() => Some(unit),
            UnitSense::Known(_) if choice.factor.is_none() => {
                let unit = choice.unit.map_or(quantity.example_unit(), |unit| unit.name);
                return Err(format!(
                    "`columns` {quantity}: column {} has a unit that is not one of {}; name another column, or state the factor, as in \
                     {quantity}={}:{unit}*1 if its numbers are in {unit}",
                    self.shown(index),
                    units::usual(quantity),
                    index + 1
                ));
            }
            _ => None,
        };
        let unit = choice.unit.or(known);
        let is_clock = quantity == Quantity::Time && self.titles[index].clock;
        if unit.is_none() && !is_clock && choice.factor.is_none() && !quantity.is_bare() {
            return Err(format!(
                "`columns` {quantity}: column {} has no unit; add one of {}, as in {quantity}={}:{}, or a factor to SI",
                self.shown(index),
                units::usual(quantity),
                index + 1,
                quantity.example_unit()
            ));
        }
        let name = unit.map_or(if is_clock { "time of day" } else { "" }, |unit| unit.name).to_owned();
        let factor = unit.map_or(1.0, |unit| unit.factor) * choice.factor.unwrap_or(1.0);
        Ok(Some(Chosen { quantity, index, unit: name, factor, by: By::Choice }))
    }

    /// The index of the column with a `name`: as it is written, or else without its unit.
    fn by_name(&self, quantity: Quantity, name: &str) -> Result<usize, String> {
        let having = |test: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..self.titles.len()).filter(|&k| test(&self.titles[k].name)).collect()
        };
        let begins = |title: &str| title.to_lowercase().strip_prefix(&name.to_lowercase()).is_some_and(names::is_unit);
        let found =
            [having(&|title| title == name), having(&|title| title.eq_ignore_ascii_case(name)), having(&begins)];
        match found.iter().find(|found| !found.is_empty()).map(Vec::as_slice) {
            Some([one]) => Ok(*one),
            Some([first, second, ..]) => Err(format!(
                "`columns` {quantity}={name:?} may be column {} or {}; give the number",
                self.shown(*first),
                self.shown(*second)
            )),
            _ => Err(format!("`columns`: no column {name:?}; there are {}", self.list())),
        }
    }

    /// Refuses a column that was chosen twice.
    fn refuse_doubles(&self, chosen: &[Chosen]) -> Result<(), String> {
        let earlier = |(k, column): (usize, &Chosen)| {
            let other = chosen[..k].iter().find(|other| other.index == column.index)?;
            Some((other.quantity, column.quantity, column.index))
        };
        match chosen.iter().enumerate().find_map(earlier) {
            Some((one, other, index)) => Err(format!(
                "`columns`: column {} is both {one} and {other}; name another column for one of them",
                self.shown(index)
            )),
            None => Ok(()),
        }
    }

    /// Whether the column at `index` has a unit of `quantity`.
    fn has_unit(&self, quantity: Quantity, index: usize) -> bool {
        match self.senses[index].unit {
            UnitSense::Clock => quantity == Quantity::Time,
            unit => unit.is_of(quantity.measure()),
        }
    }

    /// The column whose words name `quantity`. Others that are known by their unit alone are its rivals.
    fn named(&self, quantity: Quantity, taken: &[usize]) -> Result<Option<Chosen>, String> {
        let named: Vec<usize> =
            (0..self.titles.len()).filter(|k| !taken.contains(k) && self.senses[*k].named == Some(quantity)).collect();
        if quantity.is_bare() {
            return self.bare(quantity, &named);
        }
        if let Some(&index) = named.iter().find(|k| self.senses[**k].unit == UnitSense::Conflict) {
            return Err(self.no_unit(quantity, index, "has one unit in its name and another below it"));
        }
        let may_have_unit = |k: &usize| {
            self.has_unit(quantity, *k) || matches!(self.senses[*k].unit, UnitSense::Missing | UnitSense::MilliOrMega)
        };
        let mut candidates: Vec<usize> = named.iter().copied().filter(may_have_unit).collect();
        if candidates.is_empty() {
            return Ok(None);
        }
        // The one that is meant, where its unit is rare or in a wrong encoding.
        candidates.extend(named.iter().filter(|k| self.senses[**k].unit == UnitSense::Unread));
        candidates.sort_unstable();
        // A command has a name of its own: no other column is taken for one.
        if quantity != Quantity::Command {
            candidates.extend(self.of_unit(quantity, taken, true).into_iter().filter(|k| !named.contains(k)));
            candidates.sort_unstable();
        }
        let chosen = self.one_of(quantity, &candidates, By::Name)?;
        if quantity == Quantity::Displacement {
            self.refuse_other_sensor(chosen.index, &named)?;
        }
        Ok(Some(chosen))
    }

    /// Refuses a displacement that may be that of a machine beside a sensor that shows volts.
    fn refuse_other_sensor(&self, index: usize, named: &[usize]) -> Result<(), String> {
        let is_in_volts = |k: &&usize| self.senses[**k].unit.is_of(Quantity::Voltage);
        let is_other = |k: &&usize| names::is_of_machine(&self.titles[index], &self.titles[**k]);
        match named.iter().filter(is_in_volts).find(is_other) {
            Some(&other) => Err(format!(
                "columns {} and {} may be the displacement; choose one with `columns` displacement={} or, with the mm of a volt as NUMBER, \
                 displacement={}:mm*NUMBER",
                self.shown(index),
                self.shown(other),
                index + 1,
                other + 1
            )),
            None => Ok(()),
        }
    }

    /// The columns without a name that is known here and with a unit of `quantity`. Volts are the output of many sensors; as `rivals` of a
    /// voltage those of an amplifier count. Times have any name, but increase: each channel may have its own.
    fn of_unit(&self, quantity: Quantity, taken: &[usize], rivals: bool) -> Vec<usize> {
        let is_volts = |unit: Unit| unit.quantity == Quantity::Voltage && unit.factor <= 1.0;
        let increases = |k: &usize| self.titles[*k].increases;
        let fits = |k: &usize| {
            let sense = &self.senses[*k];
            !taken.contains(k)
                && (sense.named.is_none() || quantity == Quantity::Time)
                && self.has_unit(quantity, *k)
                && (!sense.unit.known().is_some_and(is_volts) || (rivals && sense.of_amplifier))
        };
        let mut found: Vec<usize> = (0..self.titles.len()).filter(fits).collect();
        if quantity == Quantity::Time && (rivals || found.iter().any(increases)) {
            found.retain(increases);
        }
        found
    }

    /// A column without a unit.
    fn bare(&self, quantity: Quantity, named: &[usize]) -> Result<Option<Chosen>, String> {
        let number = |index: usize| format!("`columns` {quantity}={}", index + 1);
        match named {
            [] => Ok(None),
            // Most things that are called weight hang on a film.
            [index, ..] if quantity == Quantity::Weight => match self.senses[*index].unit {
                UnitSense::Missing => Err(format!(
                    "column {} is a mass, or the weight of its row in a fit: {} for the latter, `columns` weight=none otherwise",
                    self.shown(*index),
                    number(*index)
                )),
                _ => Ok(None),
            },
            [one] if self.senses[*one].unit == UnitSense::Missing => {
                Ok(Some(Chosen { quantity, index: *one, unit: String::new(), factor: 1.0, by: By::Name }))
            }
            [one] => Err(format!(
                "column {} has a unit, and a {quantity} is a number without; state the factor, as in {}*0.01",
                self.shown(*one),
                number(*one)
            )),
            several => Err(self.several(quantity, several)),
        }
    }

    /// The only one of the `candidates` for `quantity`.
    fn one_of(&self, quantity: Quantity, candidates: &[usize], by: By) -> Result<Chosen, String> {
        let &[index] = candidates else { return Err(self.several(quantity, candidates)) };
        let sense = &self.senses[index];
        if let Some(doubt) = sense.doubt {
            return Err(format!(
                "column {} {}; if it is the {quantity}, {}, otherwise name another column, or `columns` {quantity}=none",
                self.shown(index),
                doubt.text(),
                self.choice(quantity, index)
            ));
        }
        let chosen = |unit: &str, factor: f64, by: By| Ok(Chosen { quantity, index, unit: unit.into(), factor, by });
        match sense.unit {
            UnitSense::Known(unit) => chosen(unit.name, unit.factor, by),
            UnitSense::Clock => chosen("time of day", 1.0, by),
            UnitSense::Missing if quantity == Quantity::Time && self.times == Origin::Preamble => {
                chosen("", 1.0, By::Preamble)
            }
            UnitSense::MilliOrMega => Err(self.no_unit(quantity, index, "has a unit that may be milli or mega")),
            // Its first row is the error.
            _ if quantity == Quantity::Time && self.titles[index].text => chosen("time of day", 1.0, by),
            _ => Err(self.no_unit(quantity, index, "has no unit")),
        }
    }

    /// Hint that chooses the column at `index`: `columns` voltage=2:kV.
    fn choice(&self, quantity: Quantity, index: usize) -> String {
        let is_known = self.has_unit(quantity, index) || quantity.is_bare();
        let unit = if is_known { String::new() } else { format!(":{}", quantity.example_unit()) };
        format!("`columns` {quantity}={}{unit}", index + 1)
    }

    /// Refuses a column that is `quantity` by its name and something else by its unit: a laser in volts. One that is not `sought` is ignored
    /// unless its unit is that of another quantity; volts are the output of a sensor.
    fn refuse_other_unit(&self, quantity: Quantity, taken: &[usize], sought: bool) -> Result<(), String> {
        let is_other = |unit: Unit| unit.quantity != Quantity::Voltage;
        let named = |k: &usize| {
            let sense = &self.senses[*k];
            sense.named == Some(quantity)
                && !quantity.is_bare()
                && !taken.contains(k)
                && (sought || sense.unit.known().is_some_and(is_other))
        };
        match (0..self.titles.len()).find(named) {
            Some(index) => Err(format!(
                "column {} is the {quantity} by its name, but its unit is not one of {}; say what one of its numbers is in SI units, as in \
                 `columns` {quantity}={}*0.001, or leave it out with `columns` {quantity}=none",
                self.shown(index),
                units::usual(quantity),
                index + 1
            )),
            None => Ok(()),
        }
    }

    /// Refuses a force as the drive beside volts that no name explains: they may be those of the film.
    fn refuse_force_beside_volts(
        &self,
        chosen: &[Chosen],
        choices: &Choices,
        request: &Request<'_>,
    ) -> Result<(), String> {
        let has = |quantity: Quantity| chosen.iter().any(|column| column.quantity == quantity);
        if !request.wants(Quantity::Voltage)
            || choices.get(Quantity::Voltage).is_some()
            || has(Quantity::Voltage)
            || !has(Quantity::Force)
        {
            return Ok(());
        }
        let is_free = |k: &usize| self.senses[*k].named.is_none() && chosen.iter().all(|column| column.index != *k);
        let is_field = |k: &usize| FIELDS.iter().any(|unit| self.shown(*k).contains(unit));
        match (0..self.titles.len()).filter(is_free).find(|k| self.has_unit(Quantity::Voltage, *k) || is_field(k)) {
            Some(index) if is_field(&index) => Err(format!(
                "column {} is an electric field, which drives the film: `columns` voltage={}:V*NUMBER with the thickness of the film in \
                 the unit of the field, or voltage=none if the force drives the film",
                self.shown(index),
                index + 1
            )),
            Some(index) => Err(format!(
                "column {} may be the voltage, which drives the film, or the output of a sensor: {} (with a factor such as *1000 for \
                 the monitor of an amplifier), or `columns` voltage=none if the force drives the film",
                self.shown(index),
                self.choice(Quantity::Voltage, index)
            )),
            None => Ok(()),
        }
    }

    fn no_unit(&self, quantity: Quantity, index: usize, why: &str) -> String {
        format!(
            "column {} {why}: {}? Say it with `columns` {quantity}={}:{}",
            self.shown(index),
            units::usual(quantity),
            index + 1,
            quantity.example_unit()
        )
    }

    fn several(&self, quantity: Quantity, indices: &[usize]) -> String {
        let first = || indices.iter().take(MAX_SHOWN);
        let shown: Vec<String> = first().map(|index| self.shown(*index)).collect();
        let choices: Vec<String> = first().map(|index| self.choice(quantity, *index)).collect();
        format!(
            "{} columns may be the {quantity}: {}; choose one with {}",
            indices.len(),
            shown.join(" and "),
            choices.join(" or ")
        )
    }

    fn missing(&self, set: &[Quantity], request: &Request<'_>) -> String {
        let choice = |quantity: Quantity, column: &str| match quantity.example_unit() {
            "" => format!("{quantity}={column}"),
            unit => format!("{quantity}={column}:{unit}"),
        };
        let names: Vec<String> = set.iter().map(|quantity| quantity.expected(request).to_owned()).collect();
        if self.titles.iter().all(|title| title.name.is_empty()) {
            let first = request.needed.iter().filter_map(|set| set.first());
            let all: Vec<String> = first.zip(1..).map(|(quantity, k)| choice(*quantity, &k.to_string())).collect();
            let columns = self.titles.len();
            return format!(
                "no header above {columns} columns; name them by number, as in `columns` {}",
                all.join(",")
            );
        }
        format!(
            "no column {}; there are {}; name it with `columns` {}{}",
            names.join(" or "),
            self.list(),
            set.first().map_or_else(String::new, |quantity| choice(*quantity, "NUMBER")),
            match *set {
                [Quantity::Time] =>
                    ", or state the rate of the rows: import with `rate_hz`; if these are no names, name their line with `header_line`",
                _ => "",
            }
        )
    }

    /// `2 "HV mon (V)"`.
    fn shown(&self, index: usize) -> String {
        let title = &self.titles[index];
        let unit = title.unit.as_deref().filter(|unit| !unit.trim().is_empty());
        let unit = unit.map_or_else(String::new, |unit| format!(" {}", unit.trim()));
        format!("{} {:?}{unit}", index + 1, title.name.chars().take(40).collect::<String>())
    }

    fn list(&self) -> String {
        let mut shown: Vec<String> = (0..self.titles.len().min(MAX_SHOWN)).map(|index| self.shown(index)).collect();
        if self.titles.len() > MAX_SHOWN {
            shown.push("…".into());
        }
        shown.join(", ")
    }
}
