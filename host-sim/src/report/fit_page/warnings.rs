//! Warnings, the most severe first, with what follows from them.

use maud::{Markup, html};

use crate::fit::{Severity, Warning};

/// The severities with their class, their word, and what follows.
const SEVERITIES: [(Severity, &str, &str, &str); 3] = [
    (Severity::Serious, "serious", "Serious", "Settle these before a voltage is computed with this fit."),
    (Severity::Caution, "caution", "Caution", "The fit can be used; its accuracy is limited as these say."),
    (Severity::Note, "note", "Note", "These change nothing in what a controller does with the fit."),
];

/// The warnings in groups; `tested` if the uncertainty was computed, which finds most of them.
pub fn list(warnings: &[Warning], tested: bool) -> Markup {
    html! {
        @if warnings.is_empty() {
            @if tested {
                p { "None: the recordings determine the model, and it follows them." }
            } @else {
                p { "None. The uncertainty was not computed, so it is not known whether the recordings determine the model." }
            }
        }
        @for (severity, class, word, follows) in SEVERITIES {
            @let group: Vec<&Warning> = warnings.iter().filter(|warning| warning.severity == severity).collect();
            @if !group.is_empty() {
                h3 { (word) " (" (group.len()) ")" }
                p { (follows) }
                ul.warnings {
                    @for warning in group { li class=(class) { span.severity { (word) ":" } (warning.text) } }
                }
            }
        }
    }
}

/// How many there are of each severity.
pub fn count(warnings: &[Warning]) -> String {
    let counts: Vec<String> = SEVERITIES
        .iter()
        .filter_map(|(severity, _, word, _)| {
            let count = warnings.iter().filter(|warning| warning.severity == *severity).count();
            (count > 0).then(|| format!("{count} {}", word.to_lowercase()))
        })
        .collect();
    match counts.as_slice() {
        [] => "no warnings".into(),
        _ => format!("warnings: {}", counts.join(", ")),
    }
}
