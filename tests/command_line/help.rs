//! Help, suggestions, completions and man pages: what a person sees who does not know the tool yet.

use std::fs;

use clap::Command;
use tests::recordings;
use tests::tool::{Bench, names, rows};

use crate::TOOL;

/// All commands that can be called, with their names below `springpot`.
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
    let calls = help.lines().filter_map(|line| line.strip_prefix("    springpot "));
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
            let words = ["springpot".to_owned()].into_iter().chain(call.iter().cloned());
            let parsed = root.clone().try_get_matches_from(words);
            assert!(parsed.is_ok(), "{call:?}: {}", parsed.expect_err("refused"));
            assert!(names.iter().all(|name| call.contains(name)), "{call:?} at {names:?}");
        }
        assert!(command.get_about().is_some(), "{names:?}");
    }
    // They are in what a person reads.
    let help = TOOL.with(&["replay", "--help"]).assert().success().get_output().stdout.clone();
    names(&String::from_utf8(help).expect("UTF-8"), &["Examples:", "springpot replay --params film.toml rec-5s.csv"]);
}

/// The files that the examples read.
fn bench() -> Bench {
    let bench = Bench::new(TOOL);
    for (recording, name) in recordings("hossain").iter().zip(["rec-13s.csv", "rec-5s.csv", "rec-7s.csv"]) {
        fs::copy(recording, bench.path(name)).expect("copied");
    }
    bench.json("reduce --params preset:table3-n1 --tolerance 1e-9 --out film.toml");
    bench.json("reference --shape sine --low 1mm --high 1.2mm --period 10s --duration 30s --out ref.csv");
    let table =
        |name: &str, header: &str, row: &dyn Fn(i32) -> String| bench.write_table(name, header, (1..300).map(row));
    table("log.csv", "time_s,command_v,monitor_v", &|k| {
        let (time, command) = (f64::from(k) / 100.0, if (50..150).contains(&k) { 1000.0 } else { 0.0 });
        let (since, after) = ((time - 0.5).max(0.0), (time - 1.5).max(0.0));
        let monitor = if k < 150 { 1000.0 * (1.0 - (-since / 0.05).exp()) } else { 1000.0 * (-after / 0.1f64).exp() };
        format!("{time},{command},{}", monitor + f64::from(k % 7))
    });
    bench.json(
        "plant --plant hossain --frequency 0.05 --duration 60 --rate 1000 --peak-voltage 5500 --tone 50 --out tone.csv",
    );
    let decay = |k: i32| f64::from(k).powf(-0.1);
    table("test.csv", "time_s,stretch,nominal_stress_pa", &|k| {
        format!("{},1.1,{}", f64::from(k) * 0.1, 2e4 * decay(k))
    });
    table("machine.csv", "time_s,displacement_mm,force_n", &|k| format!("{},5,{}", f64::from(k) * 0.1, 2.0 * decay(k)));
    bench
}

/// The examples of what computes in moments run as they are written, in one folder.
#[test]
fn examples_run() {
    let bench = bench();
    let root = host_sim::commands::command_line();
    let quick = "simulate feedforward observe amplifier reference convert export reduce frequency-response plant completions man";
    let mut run = 0;
    for name in quick.split(' ') {
        for call in examples(root.find_subcommand(name).expect("a command")) {
            assert!(!bench.prints(&call.join(" ")).is_empty(), "{call:?}");
            run += 1;
        }
    }
    assert!(run >= 18, "{run} examples");
}

#[test]
fn completions_and_man_pages() {
    let bench = Bench::new(TOOL);
    for (shell, word) in [("bash", "complete -F"), ("zsh", "#compdef"), ("fish", "complete -c springpot")] {
        names(&bench.prints(&format!("completions {shell}")), &[word, "closed-loop", "max-voltage"]);
    }
    names(bench.json("completions bash")["script"].as_str().expect("a script"), &["complete -F"]);
    names(&bench.prints("man"), &[".TH springpot 1", "feedforward"]);
    assert!(rows(&bench.json("man --out share/man1")["files"]).len() > 30);
    let words = ["springpot\\-link\\-play", "carry\\-over", "Examples:"];
    names(&bench.read("share/man1/springpot-link-play.1"), &words);
    for line in ["--help", "--version"] {
        let output = bench.run(line);
        assert!(output.status.success() && !output.stdout.is_empty() && output.stderr.is_empty(), "{line}");
    }
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
