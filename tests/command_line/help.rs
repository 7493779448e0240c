//! Help, suggestions, completions and man pages: what a person sees who does not know the tool yet.

use std::fs;
use std::path::Path;

use clap::Command;
use tempfile::TempDir;
use tests::recordings;
use tests::tool::{names, text};

use crate::TOOL;

/// All commands that can be called, with their names below `host-sim`.
fn commands(command: &Command, above: &[String], all: &mut Vec<(Vec<String>, Command)>) {
    for below in command.get_subcommands() {
        let names: Vec<String> = above.iter().cloned().chain([below.get_name().to_owned()]).collect();
        commands(below, &names, all);
        all.push((names, below.clone()));
    }
}

/// The examples at the end of a command's help, word by word.
fn examples(command: &Command) -> Vec<Vec<String>> {
    let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let calls = help.lines().filter_map(|line| line.strip_prefix("    host-sim "));
    calls.map(|call| call.split(' ').map(str::to_owned).collect()).collect()
}

/// Every command has examples, each calls its own command, and its options are those of this version.
#[test]
fn examples_in_the_help_are_understood() {
    let root = host_sim::commands::command_line();
    let mut all = Vec::new();
    commands(&root, &[], &mut all);
    assert!(all.len() > 30, "{} commands", all.len());
    for (names, command) in &all {
        let calls = examples(command);
        assert!(!calls.is_empty(), "no example in the help of {names:?}");
        for call in calls {
            let words = ["host-sim".to_owned()].into_iter().chain(call.iter().cloned());
            let parsed = root.clone().try_get_matches_from(words);
            assert!(parsed.is_ok(), "{call:?}: {}", parsed.expect_err("refused"));
            assert!(names.iter().all(|name| call.contains(name)), "{call:?} at {names:?}");
        }
        assert!(command.get_about().is_some(), "{names:?}");
    }
    // They are in what a person reads.
    let help = TOOL.with(&["replay", "--help"]).assert().success().get_output().stdout.clone();
    names(&String::from_utf8(help).expect("UTF-8"), &["Examples:", "host-sim replay --params film.toml rec-5s.csv"]);
}

/// The files that the examples read.
fn bench(folder: &Path) {
    let file = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    for (recording, name) in recordings("hossain").iter().zip(["rec-13s.csv", "rec-5s.csv", "rec-7s.csv"]) {
        fs::copy(recording, file(name)).expect("copied");
    }
    TOOL.json(&["reduce", "--params", "preset:table3-n1", "--tolerance", "1e-9", "--out", &file("film.toml")]);
    let shape = ["--shape", "sine", "--low", "1mm", "--high", "1.2mm", "--period", "10s", "--duration", "30s"];
    TOOL.json(&[&["reference"][..], &shape, &["--out", &file("ref.csv")]].concat());
    let rows = (0..300).map(|k| {
        let (time, command) = (f64::from(k) / 100.0, if (50..150).contains(&k) { 1000.0 } else { 0.0 });
        let since = (time - 0.5).max(0.0);
        let after = (time - 1.5).max(0.0);
        let monitor = if k < 150 { 1000.0 * (1.0 - (-since / 0.05).exp()) } else { 1000.0 * (-after / 0.1f64).exp() };
        format!("{time},{command},{}\n", monitor + f64::from(k % 7))
    });
    fs::write(file("log.csv"), "time_s,command_v,monitor_v\n".to_owned() + &rows.collect::<String>()).expect("written");
    let stretch = (1..200).map(|k| format!("{},1.1,{}\n", f64::from(k) * 0.1, 2e4 * f64::from(k).powf(-0.1)));
    let stretch = "time_s,stretch,nominal_stress_pa\n".to_owned() + &stretch.collect::<String>();
    fs::write(file("test.csv"), stretch).expect("written");
    let machine = (1..200).map(|k| format!("{},5,{}\n", f64::from(k) * 0.1, 2.0 * f64::from(k).powf(-0.1)));
    let machine = "time_s,displacement_mm,force_n\n".to_owned() + &machine.collect::<String>();
    fs::write(file("machine.csv"), machine).expect("written");
}

/// The examples of what computes in moments run as they are written, in one folder.
#[test]
fn examples_run() {
    let folder = TempDir::new().expect("a folder");
    bench(folder.path());
    let root = host_sim::commands::command_line();
    let quick = ["simulate", "feedforward", "observe", "amplifier", "reference", "convert", "export", "reduce"];
    let quick = [&quick[..], &["frequency-response", "plant", "completions", "man"]].concat();
    let mut run = 0;
    for name in quick {
        for call in examples(root.find_subcommand(name).expect("a command")) {
            let command = std::process::Command::new(TOOL.0).args(&call).current_dir(folder.path()).output();
            let output = command.expect("runs");
            let printed = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success(), "{call:?}: {printed}");
            assert!(!output.stdout.is_empty(), "{call:?}");
            run += 1;
        }
    }
    assert!(run >= 18, "{run} examples");
}

#[test]
fn completions_and_man_pages() {
    for (shell, word) in [("bash", "complete -F"), ("zsh", "#compdef"), ("fish", "complete -c host-sim")] {
        let script = TOOL.with(&["completions", shell]).assert().success().get_output().stdout.clone();
        names(&String::from_utf8(script).expect("UTF-8"), &[word, "closed-loop", "max-voltage"]);
    }
    names(TOOL.json(&["completions", "bash"])["script"].as_str().expect("a script"), &["complete -F"]);
    let page = TOOL.with(&["man"]).assert().success().get_output().stdout.clone();
    names(&String::from_utf8(page).expect("UTF-8"), &[".TH host-sim 1", "feedforward"]);

    let folder = TempDir::new().expect("a folder");
    let pages = folder.path().join("share/man1");
    let report = TOOL.json(&["man", "--out", text(&pages)]);
    assert!(report["files"].as_array().expect("a list").len() > 30, "{report}");
    let page = fs::read_to_string(pages.join("host-sim-link-play.1")).expect("written");
    names(&page, &["host\\-sim\\-link\\-play", "carry\\-over", "Examples:"]);
}

/// No terminal, or `NO_COLOR`: no escapes. `CLICOLOR_FORCE` asks for them all the same.
#[test]
fn colours_are_for_terminals() {
    let has_escapes = |variables: &[(&str, &str)]| {
        let output = |arguments: &[&str]| TOOL.with(arguments).envs(variables.iter().copied()).output().expect("runs");
        let (help, error) = (output(&["replay", "--help"]).stdout, output(&["replay"]).stderr);
        [help, error].map(|bytes| bytes.contains(&0x1b))
    };
    assert_eq!(has_escapes(&[]), [false, false]);
    assert_eq!(has_escapes(&[("CLICOLOR_FORCE", "1")]), [true, true]);
    assert_eq!(has_escapes(&[("CLICOLOR", "1")]), [false, false]);
    assert_eq!(has_escapes(&[("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")]), [false, false]);
}
