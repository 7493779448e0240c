//! Pages: the numbers in them are those of `--json`, and they need nothing but themselves.

use serde_json::Value;
use tests::thinned_recordings;
use tests::tool::{Bench, names, warns};

use crate::TOOL;

/// Most bytes of a page of three recordings.
const MAX_BYTES: usize = 1_000_000;

/// The text between `begin` and `end`, as often as it occurs.
fn between<'a>(text: &'a str, begin: &'a str, end: &'a str) -> impl Iterator<Item = &'a str> {
    text.split(begin).skip(1).map(move |rest| rest.split(end).next().expect("a part"))
}

/// The document that is embedded in `page`.
pub fn document(page: &str) -> Value {
    let embedded: Vec<&str> = between(page, r#"<script type="application/json" id="document">"#, "</script>").collect();
    assert_eq!(embedded.len(), 1, "one document");
    serde_json::from_str(embedded[0]).expect("JSON")
}

/// Asserts that every number of `page` is the one in `document` at the place that it names, and reads as such; returns how many.
pub fn check_numbers(page: &str, document: &Value) -> usize {
    let attribute = |element: &str, name: &str| -> String {
        between(element, &format!("{name}=\""), "\"").next().expect("an attribute").to_owned()
    };
    let elements: Vec<&str> = between(page, "<data ", "</data>").collect();
    for element in &elements {
        let place = attribute(element, "data-at");
        let value: f64 = attribute(element, "value").parse().expect("a number");
        let factor: f64 = attribute(element, "data-factor").parse().expect("a factor");
        assert_eq!(document.pointer(&place).and_then(Value::as_f64), Some(value), "{place}");
        // One unit of the last digit that is shown: half of it is rounding.
        let (_, shown) = element.split_once('>').expect("text");
        let number = shown.split_whitespace().next().expect("a number");
        let (mantissa, exponent) = number.split_once('e').unwrap_or((number, "0"));
        let decimals = mantissa.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        let unit = 10f64.powi(exponent.parse::<i32>().expect("an exponent") - i32::try_from(decimals).expect("few"));
        let read: f64 = number.parse().expect("a number");
        assert!((read - factor * value).abs() <= 0.500_001 * unit, "{place}: {shown} is not {value}");
    }
    elements.len()
}

/// Asserts what every page holds to: it loads nothing, is small, and can be read by a screen reader.
pub fn check_page(page: &str) {
    assert!(page.len() <= MAX_BYTES, "{} bytes", page.len());
    let own = page.replace("https://github.com/leeoniya/uPlot", "");
    for loaded in [" src=\"", "href=\"http", "url(", "@import", "<link", "<img", "<iframe"] {
        assert!(!own.contains(loaded), "{loaded}");
    }
    assert!(page.contains("default-src 'none'") && page.contains("Copyright (c) 2022 Leon Sorokin"));
    assert!(page.starts_with("<!DOCTYPE html><html lang=\"en\">"));
    assert_eq!(page.matches("<h1>").count(), 1);
    for table in between(page, "<table>", "</table>") {
        assert!(table.starts_with("<caption>") && !table.starts_with("<caption></caption>"), "{table}");
        assert_eq!(table.matches("<th scope=\"row\">").count(), table.matches("<tr").count() - 1);
    }
    for figure in between(page, "<figure class=\"chart\"", "</figure>") {
        assert!(figure.contains("<h4>") && figure.contains("aria-label=\"Plot ") && figure.contains("tabindex=\"0\""));
        let data = between(figure, "<script type=\"application/json\">", "</script>").next().expect("data");
        let data: Value = serde_json::from_str(data).expect("JSON");
        for line in data["lines"].as_array().expect("lines") {
            let points = |axis: &str| line[axis].as_array().expect("numbers").len();
            assert!(points("x") == points("y") && points("x") > 0 && points("x") <= 1600, "{}", line["label"]);
            assert!(!line["label"].as_str().expect("a name").is_empty());
        }
    }
    for anchor in between(page, "<a href=\"#", "\"") {
        assert_eq!(page.matches(&format!("<section id=\"{anchor}\"")).count(), 1, "{anchor}");
    }
}

#[test]
fn a_page_of_a_fit_holds_the_numbers_of_json_and_every_part() {
    let bench = Bench::new(TOOL);
    let files = bench.recordings("wang");
    let structure = "--branches 1 --topology parallel --curve none";
    let printed = bench.json(&format!("fit {structure} --out p.toml --report p.html {files}"));
    let page = bench.read("p.html");
    assert_eq!(document(&page), printed);
    assert!(check_numbers(&page, &printed) > 50);
    check_page(&page);
    let parts = [
        "Measured and modelled",
        "Residual",
        "Drive",
        "Displacement against voltage",
        "Creep: change of each cycle",
        "Spectrum",
        "Displacement over force",
        "recorded",
        "95 % intervals",
        "Relaxation times",
        "thickness",
        "SHA-256",
        "UTC",
        "springpot fit",
        "Bounds of what the compressed memory changes",
        "Cost on a Cortex-M4F",
    ];
    names(&page, &parts);
    let digest = printed["recordings"][0]["sha256"].as_str().expect("a digest");
    assert!(digest.len() == 64 && page.contains(digest));
}

/// A relaxation is drawn on logarithmic time without being asked for; names that would be elements of a page are text.
#[test]
fn a_relaxation_gets_logarithmic_time_and_names_are_escaped() {
    let bench = Bench::new(TOOL);
    let file = "<script>alert(1)<img src=x> & 'co'.csv";
    // A springpot held at 1 mm: F = c x t^-α / Γ(1 - α), with α = 0.2 and Γ(0.8) = 1.1642.
    let row = |t: f64| format!("{t},0.001,{}", 5e4 * 1e-3 * t.powf(-0.2) / 1.1642);
    bench.write_table(file, "time_s,displacement_m,force_n", (1..=400).map(|k| row(0.25 * f64::from(k))));
    let fit =
        "fit --json --drive displacement --branches 0 --topology parallel --curve none --out p.toml --report p.html";
    let output = bench.with(fit).arg(file).assert().success().get_output().stdout.clone();
    let printed: Value = serde_json::from_slice(&output).expect("one document");
    let page = bench.read("p.html");
    names(&page, &["Relaxation on logarithmic time", r#""logX":true"#]);
    assert_eq!(document(&page), printed);
    check_page(&page);
    assert!(page.contains("&lt;script&gt;alert(1)&lt;img src=x&gt; &amp; 'co'.csv"));
    assert!(!page.contains("<script>alert") && !page.contains("<img"));
    // Warnings show their severity.
    let severities = between(&page, "<span class=\"severity\">", "<").count();
    assert_eq!(severities, printed["warnings"].as_array().expect("a list").len());
    assert!(warns(&printed, "constant"), "{printed}");
}

/// The structures that were compared are in the page, the chosen one marked in words as well as in colour.
#[test]
fn compared_structures_are_in_the_page() {
    let bench = Bench::new(TOOL);
    thinned_recordings("wang", &bench.path(""), 20);
    let fit = "fit --curve none --topology parallel --out p.toml --report p.html wang-5s.csv wang-7s.csv";
    let printed = bench.json(fit);
    let page = bench.read("p.html");
    check_numbers(&page, &printed);
    let rows = between(&page, "Structures that were compared</caption>", "</table>").next().expect("a table");
    assert_eq!(rows.matches("(chosen)").count(), 1);
    assert_eq!(rows.matches("<tr").count(), 1 + printed["structures"].as_array().expect("a list").len());
}
