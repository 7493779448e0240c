//! Examples in the help of each command.

use std::fmt::Write;

use clap::Command;

/// A command by its names below `host-sim`, and its examples: what each does, and how it is called.
type Examples = (&'static [&'static str], &'static [(&'static str, &'static str)]);

const EXAMPLES: &[Examples] = &[
    (
        &[],
        &[
            ("Everything once, on a simulated film", "demo"),
            ("A model of your film", "fit rec-5s.csv rec-7s.csv rec-13s.csv --out film.toml --report film.html"),
            ("How well it holds", "replay --params film.toml rec-13s.csv"),
            ("A voltage that makes it follow", "feedforward --params film.toml --reference ref.csv --out volts.csv"),
        ],
    ),
    (
        &["demo"],
        &[
            ("On a simulated film", "demo --out demo"),
            ("On a film of your own", "demo --recordings rec-5s.csv rec-7s.csv --actuator film.toml --out mine"),
        ],
    ),
    (
        &["import"],
        &[
            ("Files of other programs as recordings", "import lab.csv --out recordings"),
            (
                "With columns that are named, from 2 s on",
                "import lab.csv --columns time=1:s,voltage=2:kV,displacement=3:mm --from 2s --out recordings",
            ),
        ],
    ),
    (
        &["check"],
        &[("Whether recordings identify a film; exit status 1 if not", "check rec-5s.csv rec-7s.csv rec-13s.csv")],
    ),
    (
        &["profile"],
        &[(
            "A voltage that identifies a film within 5 kV",
            "profile --board film.toml --peak 5kV --frequencies 0.2Hz,70mHz --hold 1min --out profile.csv",
        )],
    ),
    (
        &["simulate"],
        &[
            ("As the controller computes it", "simulate --params film.toml --profile rec-5s.csv --out response.csv"),
            (
                "The exact answer",
                "simulate --params film.toml --profile rec-5s.csv --memory full --precision f64 --out exact.csv",
            ),
        ],
    ),
    (
        &["replay"],
        &[
            ("How well a model holds", "replay --params film.toml rec-5s.csv rec-7s.csv"),
            ("What a plain window of 10 s costs", "replay --params film.toml --memory window:10s rec-13s.csv"),
            ("At another rate, with the responses", "replay --params film.toml --rate 2kHz --out responses rec-5s.csv"),
        ],
    ),
    (
        &["fit"],
        &[
            ("The structure is chosen", "fit rec-5s.csv rec-7s.csv rec-13s.csv --out film.toml --report film.html"),
            (
                "One structure, in seconds",
                "fit rec-5s.csv --topology parallel --branches 1 --curve none --out film.toml",
            ),
            ("A relaxation", "fit relaxation.csv --drive displacement --weights log-time --out body.toml"),
            ("The first 30 s alone", "fit rec-13s.csv --to 30s --branches 1 --curve none --out early.toml"),
        ],
    ),
    (
        &["feedforward"],
        &[
            (
                "Whether the film can follow; exit status 1 if not",
                "feedforward --params film.toml --reference ref.csv --check",
            ),
            ("The voltage", "feedforward --params film.toml --reference ref.csv --out volts.csv"),
            (
                "Within other limits",
                "feedforward --params film.toml --reference ref.csv --max-voltage 5.5kV --max-slew 20kV/s --out volts.csv",
            ),
        ],
    ),
    (
        &["observe"],
        &[(
            "The observer over a recording",
            "observe --params film.toml rec-5s.csv --bandwidth 0.5Hz --out estimate.csv",
        )],
    ),
    (
        &["closed-loop"],
        &[
            (
                "Tracking on a simulated film",
                "closed-loop --plant hossain --params film.toml --reference ref.csv --controller tracking",
            ),
            (
                "A sensor that is lost for 30 s",
                "closed-loop --plant wang --params film.toml --reference ref.csv --controller tracking --sensor-lost 10s:40s",
            ),
        ],
    ),
    (
        &["amplifier"],
        &[("How fast an amplifier follows", "amplifier log.csv --params film.toml --out film-and-amplifier.toml")],
    ),
    (
        &["reference"],
        &[
            (
                "A sine of 2 to 2.5 mm",
                "reference --shape sine --low 2mm --high 2.5mm --period 10s --duration 2min --out sine.csv",
            ),
            (
                "Steps with edges of 1 s",
                "reference --shape steps --low 1.5mm --high 2.5mm --period 20s --rise 1s --out steps.csv",
            ),
        ],
    ),
    (
        &["compare"],
        &[
            ("Other models of creep", "compare rec-5s.csv rec-7s.csv"),
            ("What they predict beyond 60 s", "compare rec-5s.csv --to 60s"),
        ],
    ),
    (&["study"], &[("The paper's study", "study rec-5s.csv rec-7s.csv rec-13s.csv --out study")]),
    (
        &["convert"],
        &[
            ("A file of a testing machine", "convert machine.csv --out relaxation.csv"),
            ("Stretch and stress", "convert test.csv --length 50mm --area 4mm2 --out body.csv"),
        ],
    ),
    (
        &["export"],
        &[
            ("For a board, by the link or the flash", "export --params film.toml --rate 1kHz --out film.bin"),
            ("For a program", "export --params film.toml --emit rust --out film.rs"),
            ("The law in C, with springpot.h", "export --params film.toml --emit c --out film.c"),
            ("A library for Arduino", "export --params film.toml --emit arduino --out film_arduino"),
            ("For MATLAB, Octave and Simulink", "export --params film.toml --emit sfunction --out film.c"),
            (
                "An FMU for co-simulation, of FMI 3.0; fmu2 is of 2.0",
                "export --params film.toml --emit fmu --out film.fmu",
            ),
        ],
    ),
    (
        &["pil"],
        &[
            ("The firmware in QEMU", "pil --params film.toml rec-5s.csv --duration 10s"),
            ("A board", "pil --params film.toml --port /dev/ttyUSB0 rec-5s.csv"),
            ("Tracking around it", "pil --params film.toml --law tracking --plant hossain ref.csv"),
        ],
    ),
    (
        &["link"],
        &[
            ("Who is there", "link --port /dev/ttyUSB0 identify"),
            ("Send parameters", "link --port /dev/ttyUSB0 upload --params film.toml"),
            ("Play a voltage", "link --port tcp:127.0.0.1:5555 play volts.csv --out log.csv"),
        ],
    ),
    (&["link", "identify"], &[("Who is there", "link --port /dev/ttyUSB0 identify")]),
    (&["link", "status"], &[("As JSON", "link --port /dev/ttyUSB0 status --json")]),
    (&["link", "arm"], &[("The token goes on with start and set", "link --port /dev/ttyUSB0 arm")]),
    (&["link", "start"], &[("By who has armed", "link --port /dev/ttyUSB0 start tracking --token 4711")]),
    (&["link", "stop"], &[("0 V, still armed", "link --port /dev/ttyUSB0 stop")]),
    (&["link", "disarm"], &[("0 V, amplifier disabled", "link --port /dev/ttyUSB0 disarm")]),
    (&["link", "acknowledge"], &[("After a trip, once its cause is found", "link --port /dev/ttyUSB0 acknowledge")]),
    (&["link", "reload"], &[("After a trial of others", "link --port /dev/ttyUSB0 reload")]),
    (
        &["link", "set"],
        &[
            ("A voltage", "link --port /dev/ttyUSB0 set --voltage 1.5kV --token 4711"),
            ("A displacement", "link --port /dev/ttyUSB0 set --reference 2.2mm --token 4711"),
        ],
    ),
    (&["link", "learning"], &[("Before another reference", "link --port /dev/ttyUSB0 learning forget --token 4711")]),
    (
        &["link", "upload"],
        &[
            ("They are kept", "link --port /dev/ttyUSB0 upload --params film.toml --rate 1kHz"),
            ("Until the next reset", "link --port /dev/ttyUSB0 upload --blob film.bin --try"),
        ],
    ),
    (&["link", "stream"], &[("For a minute", "link --port /dev/ttyUSB0 stream --duration 1min --out log.csv")]),
    (
        &["link", "play"],
        &[
            ("A voltage", "link --port /dev/ttyUSB0 play volts.csv --out log.csv"),
            (
                "A displacement, by the sensor, with these parameters and no others",
                "link --port /dev/ttyUSB0 play ref.csv --mode tracking --params film.toml --out log.csv",
            ),
        ],
    ),
    (&["link", "panic"], &[("Why it started again", "link --port /dev/ttyUSB0 panic")]),
    (
        &["link", "drill"],
        &[
            ("All of them, on the virtual board", "link --port tcp:127.0.0.1:4050 drill"),
            ("At another voltage", "link --port tcp:127.0.0.1:4050 drill --voltage 500V"),
        ],
    ),
    (&["link", "self-test"], &[("Before a film is connected", "link --port /dev/ttyUSB0 self-test --voltage 50V")]),
    (
        &["reduce"],
        &[("A smaller model with the same response", "reduce --params film.toml --tolerance 1% --out small.toml")],
    ),
    (
        &["frequency-response"],
        &[
            (
                "Of the model",
                "frequency-response --params film.toml --from 1mHz --to 10Hz --points 50 --out response.csv",
            ),
            (
                "Of the controller's law",
                "frequency-response --params film.toml --from 1mHz --to 10Hz --points 50 --discrete --rate 500Hz --out law.csv",
            ),
        ],
    ),
    (
        &["plant"],
        &[
            (
                "A sine of 0.2 Hz",
                "plant --plant hossain --frequency 0.2Hz --duration 60s --rate 100Hz --peak-voltage 6kV --out film.csv",
            ),
            (
                "Two tones",
                "plant --plant wang --frequency 0.2Hz --frequency 0.5Hz --duration 60s --rate 100Hz --out tones.csv",
            ),
        ],
    ),
    (&["completions"], &[("For bash, in ~/.bashrc: source <(host-sim completions bash)", "completions bash")]),
    (&["man"], &[("The page of this tool", "man"), ("A page of each command", "man --out man1")]),
];

/// `command` with the examples of its commands at the end of their help.
pub(super) fn added_to(command: Command) -> Command {
    EXAMPLES.iter().fold(command, |command, (path, examples)| added_below(command, path, &text(examples)))
}

fn added_below(command: Command, path: &'static [&'static str], text: &str) -> Command {
    match path.split_first() {
        None => command.after_help(text.to_owned()),
        Some((name, rest)) => command.mut_subcommand(*name, |below| added_below(below, rest, text)),
    }
}

fn text(examples: &[(&str, &str)]) -> String {
    let mut text = "Examples:".to_owned();
    for (what, call) in examples {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  {what}:\n    host-sim {call}");
    }
    text
}
