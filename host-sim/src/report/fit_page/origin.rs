//! What the fit was made from, when and by what.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::page::{Row, table, text};
use crate::files::recording::Direction;

/// The tables of the fit at `numbers`.
pub fn body(numbers: &Numbers<'_>, direction: Direction) -> Markup {
    let recordings: Vec<Row> = numbers
        .at("/recordings")
        .rows()
        .iter()
        .map(|row| Row::new(vec![text(row.text("/file")), html! { code.digest { (row.text("/sha256")) } }]))
        .collect();
    let drive = match direction {
        Direction::Force => "voltage or force",
        Direction::Displacement => "displacement",
    };
    let words = |name: &str, value: &str| Row::new(vec![text(name), html! { code { (value) } }]);
    let rows = [
        words("parameters", numbers.text("/parameters_file")),
        words("made", numbers.text("/made/date")),
        words("by", numbers.text("/made/tool")),
        words("command", numbers.text("/made/command")),
        Row::new(vec![text("input of the model"), text(drive)]),
        Row::new(vec![text("time of the fit"), numbers.number("/seconds", Form::In(1.0, 1, "s"))]),
        Row::new(vec![text("evaluations"), numbers.number("/evaluations", Form::Fixed(0))]),
    ];
    html! {
        (table("Recordings", &["file", "SHA-256"], &recordings))
        (table("The fit", &["", ""], &rows))
    }
}
