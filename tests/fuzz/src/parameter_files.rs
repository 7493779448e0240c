//! Parameter files: TOML text.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    fuzz_targets::parameter_files(data);
});
