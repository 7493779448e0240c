//! Compilers and their options: which give Rust's bits, and which are refused.

use std::fs;
use std::process::Command;

use host_emit::HEADER;

use crate::bits::{all_kinds, recorded};
use crate::films::{self, Case};
use crate::program::{STRICT, Sources, with};
use crate::recordings::recordings;

/// The compiled program: films that have everything between them, in one program.
fn cases() -> [Case; 3] {
    [films::plain(), films::rich(), films::in_series()]
}

/// Builds with `compiler` and `options` and compares 10 s of every kind; the program runs with `environment`.
fn has_the_bits(compiler: &str, options: &[&str]) {
    let cases = cases();
    let sources = Sources::new(&cases);
    let program = sources.compile(compiler, options);
    let [fast, ..] = recordings("hossain");
    let recorded = recorded(&fast, 10);
    for (index, case) in cases.iter().enumerate() {
        all_kinds(|job| sources.run(&mut Command::new(&program), job), (index, case), &recorded);
    }
}

/// The strictest warnings as C99, and as C++11 where sources are C++.
const STRICT_CPP: [&str; 7] = ["-x", "c++", "-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion"];

/// Options that break the arithmetic do not compile, and the error says why.
fn refuses(compiler: &str, options: &[&[&str]]) {
    for &options in options {
        let folder = tempfile::TempDir::new().expect("a folder");
        let file = folder.path().join("springpot.h");
        fs::write(&file, HEADER).expect("written");
        let compiled = Command::new(compiler).args(["-x", "c", "-fsyntax-only"]).args(options).arg(&file).output();
        let compiled = compiled.expect("there is a compiler");
        let errors = String::from_utf8_lossy(&compiled.stderr);
        assert!(!compiled.status.success(), "{compiler} {options:?} is accepted");
        assert!(errors.contains("#error") && errors.contains("springpot.h: "), "{compiler} {options:?}: {errors}");
    }
}

#[test]
fn fast_math_is_refused() {
    refuses(
        "gcc",
        &[
            &["-O2", "-ffast-math"],
            &["-Ofast"],
            &["-O2", "-ffinite-math-only"],
            &["-O2", "-funsafe-math-optimizations"],
            &["-O2", "-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"],
            &["-O2", "-freciprocal-math"],
        ],
    );
    if cfg!(target_arch = "x86_64") {
        refuses("gcc", &[&["-mfpmath=387"]]);
    }
}

/// How wide gcc says that arithmetic is: 16 on processors that also compute in half precision, where `float` stays single.
#[test]
fn wider_arithmetic_alone_is_refused() {
    let says = |method: &'static str| ["-std=gnu99", "-U__FLT_EVAL_METHOD__", method];
    refuses("gcc", &[&says("-D__FLT_EVAL_METHOD__=1"), &says("-D__FLT_EVAL_METHOD__=2")]);
    let sources = Sources::new(&cases());
    for method in ["-D__FLT_EVAL_METHOD__=0", "-D__FLT_EVAL_METHOD__=16"] {
        sources.compile("gcc", &with(&says(method), &["-O2"]));
    }
}

/// A build for a processor with fused multiply-add, in gcc's default mode, which fuses: the header switches it off. Without what
/// switches it off the same build does fuse.
#[cfg(target_arch = "x86_64")]
#[test]
fn fused_multiply_add_is_harmless() {
    let fuses = |header: &str| {
        let folder = tempfile::TempDir::new().expect("a folder");
        fs::write(folder.path().join("springpot.h"), header).expect("written");
        let code = "#include \"springpot.h\"\nfloat step(const springpot_film *f, springpot_state *s, float x);\n\
                    float step(const springpot_film *f, springpot_state *s, float x)\n{\n    return springpot_displacement(f, s, x);\n}\n";
        fs::write(folder.path().join("step.c"), code).expect("written");
        let mut gcc = Command::new("gcc");
        gcc.current_dir(folder.path()).args(["-std=gnu99", "-O3", "-mfma", "-S", "-o", "-", "step.c"]);
        String::from_utf8_lossy(&crate::program::succeeds(&mut gcc)).contains("vfmadd")
    };
    let pragma = "#pragma GCC optimize(\"fp-contract=off\")";
    assert!(HEADER.contains(pragma) && fuses(&HEADER.replace(pragma, "")), "this build shows nothing");
    assert!(!fuses(HEADER));
    if std::arch::is_x86_feature_detected!("fma") {
        has_the_bits("gcc", &["-std=gnu99", "-O3", "-mfma"]);
    }
}

/// Every level of optimisation, as C99 and C++11, by gcc and clang, each with the strictest warnings and in its default mode.
#[test]
#[ignore = "needs g++ and clang: cargo xtask faces"]
fn compilers_and_options_have_the_bits() {
    for level in ["-O0", "-O1", "-Os", "-O3"] {
        for c in ["gcc", "clang"] {
            has_the_bits(c, &with(&STRICT, &[level]));
        }
        for cpp in ["g++", "clang++"] {
            has_the_bits(cpp, &with(&STRICT_CPP, &["-Werror", level]));
        }
    }
    for native in [["-std=gnu99", "-O3", "-march=native"], ["-std=gnu11", "-O2", "-flto"]] {
        has_the_bits("gcc", &native);
        has_the_bits("clang", &[native[0], native[1], "-march=native"]);
    }
    has_the_bits("g++", &["-x", "c++", "-std=gnu++11", "-O3", "-march=native"]);
    has_the_bits("clang++", &["-x", "c++", "-std=gnu++17", "-O3", "-march=native"]);
}

#[test]
#[ignore = "needs clang: cargo xtask faces"]
fn fast_math_is_refused_by_clang() {
    refuses("clang", &[&["-O2", "-ffast-math"], &["-Ofast"], &["-O2", "-ffinite-math-only"]]);
}

/// Memory and arithmetic under the sanitizers of both compilers, along all kinds.
#[test]
#[ignore = "needs clang: cargo xtask faces"]
fn sanitizers_find_nothing() {
    let checks = ["-std=c99", "-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    has_the_bits("gcc", &with(&checks, &["-fsanitize=float-cast-overflow"]));
    has_the_bits("clang", &with(&checks, &["-fsanitize=float-cast-overflow,implicit-conversion,local-bounds"]));
}
