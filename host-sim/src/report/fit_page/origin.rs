//! Origin of the fit: its inputs, its date and its tool.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::origin;
use super::super::page::{Row, table, text};
use crate::files::recording::Direction;

/// The tables of the fit at `numbers`.
pub fn body(numbers: &Numbers<'_>, direction: Direction) -> Markup {
    let recordings = numbers.at("/recordings").rows();
    let recordings = recordings.iter().map(|row| (row.text("/file"), row.text("/sha256")));
    let drive = match direction {
        Direction::Force => "voltage or force",
        Direction::Displacement => "displacement",
    };
    let parameters = html! { code { (numbers.text("/parameters_file")) } };
    let [made, by, command] =
        origin::rows(["/made/date", "/made/tool", "/made/command"].map(|path| numbers.text(path)));
    let rows = [
        Row::new(vec![text("parameters"), parameters]),
        made,
        by,
        command,
        Row::new(vec![text("input of the model"), text(drive)]),
        Row::new(vec![text("time of the fit"), numbers.number("/seconds", Form::In(1.0, 1, "s"))]),
        Row::new(vec![text("evaluations"), numbers.number("/evaluations", Form::Fixed(0))]),
    ];
    html! {
        (origin::files_table("Recordings", recordings))
        (table("The fit", &["", ""], &rows))
    }
}
