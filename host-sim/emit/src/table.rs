//! The constants of a film as structures of C.

use std::fmt::Write;

use springpot::{Learning, Numbers, Record, SelfSensing, TemperatureDependence, Tracking};

/// Structures within `springpot_film`, in their order.
const WITHIN: [&str; 5] = ["drive", "inverse", "observer", "fade", "adaptation"];
/// Structures that `springpot_film` points to, and what a null pointer means.
const BESIDE: [(&str, &str); 6] = [
    ("curve", "NULL: force follows x itself"),
    ("spring", "NULL: no spring is beside the memory"),
    ("series", "NULL: no spring is in series with the memory"),
    ("amplifier", "NULL: it follows at once"),
    ("learning", "NULL: nothing is learned"),
    ("temperature", "NULL: it was not fitted at several"),
];
/// The structure at the end of `springpot_film`: it is the largest.
const LAST: &str = "law";
/// The structure with a symbol of its own, which a film without it does not have.
const APART: &str = "self_sensing";

/// The constants of a film, structure by structure.
#[derive(Default)]
pub(crate) struct Table(Vec<Structure>);

/// A structure of C.
struct Structure {
    name: &'static str,
    about: &'static str,
    fields: Vec<Field>,
    /// Structures that are fields of it.
    parts: Vec<Structure>,
}

/// A field of a structure.
struct Field {
    declaration: String,
    name: &'static str,
    about: &'static str,
    value: String,
}

impl Table {
    /// The constants of `tracking`, and of what learns, senses and follows the temperature, if anything does.
    pub(crate) fn new(
        tracking: &Tracking<f32>,
        learning: Option<&Learning<f32>>,
        self_sensing: Option<&SelfSensing<f32>>,
        temperature: Option<&TemperatureDependence>,
    ) -> Self {
        let mut table = Self::default();
        tracking.numbers(&mut table);
        tracking.numbers_of_changes(&mut table);
        if let Some(learning) = learning {
            learning.numbers(&mut table);
        }
        if let Some(dependence) = temperature {
            dependence.numbers(&mut table);
        }
        if let Some(sensing) = self_sensing {
            sensing.numbers(&mut table);
        }
        table
    }

    fn find(&self, name: &str) -> Option<&Structure> {
        self.0.iter().find(|structure| structure.name == name)
    }

    fn field(&mut self, name: &'static str, declaration: String, value: String, about: &'static str) {
        // The first visit is that of a structure.
        if let Some(structure) = self.0.last_mut() {
            structure.fields.push(Field { declaration, name, about, value });
        }
    }

    /// Adds the structures of `other` that are not in this table, each after the one that is before it there.
    pub(crate) fn add(&mut self, other: Self) {
        let mut at = 0;
        for structure in other.0 {
            match self.0.iter().position(|known| known.name == structure.name) {
                Some(known) => at = known + 1,
                None => {
                    self.0.insert(at, structure);
                    at += 1;
                }
            }
        }
    }

    /// Declares all structures: `c/2-film.h`, from a table that has all of them.
    pub(crate) fn declarations(&self) -> String {
        let mut text = "/* ---- A film: computed by the host, constant. Its values are for the functions below; read step_s and the limits if you like.\n \
                        * What has no unit here is a plain number. Generated from the visits of the crate springpot. */\n\n"
            .to_owned();
        self.0.iter().for_each(|structure| structure.declare(&mut text));
        let mut film = Structure {
            name: "film",
            about: "The constants of a film at its rate.",
            fields: Vec::new(),
            parts: Vec::new(),
        };
        let mut field = |declaration: String, about: &'static str| {
            film.fields.push(Field { declaration, name: "", about, value: String::new() });
        };
        field("float step_s".into(), "duration of a tick, s: call a tick at this rate and no other");
        WITHIN.iter().for_each(|name| field(format!("springpot_{name} {name}"), ""));
        BESIDE.iter().for_each(|(name, none)| field(format!("const springpot_{name} *{name}"), none));
        field(format!("springpot_{LAST} {LAST}"), "");
        film.declare(&mut text);
        text
    }

    /// Defines the film `symbol`, after the structures that it points to.
    pub(crate) fn definitions(&self, symbol: &str, step_s: f64) -> String {
        let mut text = String::new();
        for (name, structure) in BESIDE.iter().filter_map(|(name, _)| Some((name, self.find(name)?))) {
            let _ = writeln!(text, "static const springpot_{name} {symbol}_{name} = {{");
            structure.define(&mut text, "    ");
            text.push_str("};\n\n");
        }
        let _ = writeln!(text, "SPRINGPOT_FILM({symbol});\n\nconst springpot_film {symbol} = {{");
        #[allow(clippy::cast_possible_truncation)] // for its reader
        let _ = writeln!(text, "    {:.8e}F, /* step_s */", step_s as f32);
        WITHIN.iter().for_each(|name| self.define_within(&mut text, name));
        for (name, _) in BESIDE {
            let pointer = self.find(name).map_or("NULL".to_owned(), |_| format!("&{symbol}_{name}"));
            let _ = writeln!(text, "    {pointer}, /* {name} */");
        }
        self.define_within(&mut text, LAST);
        text.push_str("};\n");
        if let Some(structure) = self.find(APART) {
            let (name, macro_name) = (format!("{APART}_{symbol}"), APART.to_uppercase());
            let _ = writeln!(text, "\nSPRINGPOT_{macro_name}({name});\n\nconst springpot_{APART} {name} = {{");
            structure.define(&mut text, "    ");
            text.push_str("};\n");
        }
        text
    }

    fn define_within(&self, text: &mut String, name: &str) {
        let _ = writeln!(text, "    {{ /* {name} */");
        self.find(name).into_iter().for_each(|structure| structure.define(text, "        "));
        text.push_str("    },\n");
    }
}

impl Structure {
    // Writing to a string cannot fail.
    fn declare(&self, text: &mut String) {
        self.parts.iter().for_each(|part| part.declare(text));
        let _ = writeln!(text, "/* {} */\ntypedef struct {{", self.about);
        let width = self.fields.iter().map(|field| field.declaration.len() + 5).max().unwrap_or(0);
        for Field { declaration, about, .. } in &self.fields {
            let line = format!("    {declaration};");
            let _ = match *about {
                "" => writeln!(text, "{line}"),
                about => writeln!(text, "{line:<width$} /* {about} */"),
            };
        }
        let _ = writeln!(text, "}} springpot_{};\n", self.name);
    }

    /// Lines of its initialiser.
    fn define(&self, text: &mut String, indent: &str) {
        for Field { name, value, .. } in &self.fields {
            let _ = writeln!(text, "{indent}{value}, /* {name} */");
        }
    }
}

impl Numbers<f32> for Table {
    fn structure(&mut self, name: &'static str, about: &'static str) {
        self.0.push(Structure { name, about, fields: Vec::new(), parts: Vec::new() });
    }

    fn number(&mut self, name: &'static str, value: f32, about: &'static str) {
        self.field(name, format!("float {name}"), literal(value), about);
    }

    fn count(&mut self, name: &'static str, value: u32, about: &'static str) {
        self.field(name, format!("uint32_t {name}"), format!("{value}U"), about);
    }

    fn array<const N: usize>(&mut self, name: &'static str, values: [f32; N], about: &'static str) {
        self.field(name, format!("float {name}{}", length(name, N)), row(&values), about);
    }

    fn records<const FIELDS: usize>(
        &mut self,
        name: &'static str,
        of: &Record<FIELDS>,
        values: impl IntoIterator<Item = [f32; FIELDS]>,
        about: &'static str,
    ) {
        let rows: Vec<String> = values.into_iter().map(|values| row(&values)).collect();
        let (length, value) = match rows.as_slice() {
            [one] => (String::new(), one.clone()),
            rows => (length(name, rows.len()), format!("{{\n            {}}}", rows.join(",\n            "))),
        };
        self.field(name, format!("springpot_{} {name}{length}", of.name), value, about);
        let is_new = self.0.iter().flat_map(|structure| &structure.parts).all(|part| part.name != of.name);
        let Some(structure) = self.0.last_mut() else { return };
        if is_new {
            let field =
                |&(name, about)| Field { declaration: format!("float {name}"), name, about, value: String::new() };
            let fields = of.fields.iter().map(field).collect();
            structure.parts.push(Structure { name: of.name, about: of.about, fields, parts: Vec::new() });
        }
    }
}

/// A long array has the length that the steps count to.
fn length(name: &str, length: usize) -> String {
    if length > 4 { format!("[SPRINGPOT_{}]", name.to_uppercase()) } else { format!("[{length}]") }
}

fn row(values: &[f32]) -> String {
    let values: Vec<String> = values.iter().map(|value| literal(*value)).collect();
    format!("{{{}}}", values.join(", "))
}

/// A number as a constant of C: nine significant digits give every number of single precision back. Hexadecimal ones, which are shorter
/// to prove, are not C++11.
fn literal(value: f32) -> String {
    if value.is_infinite() {
        let sign = if value < 0.0 { "-" } else { "" };
        return format!("{sign}(float)INFINITY");
    }
    format!("{value:.8e}F")
}
