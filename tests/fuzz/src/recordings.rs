//! Recordings: CSV text.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    fuzz_targets::recordings(data);
});
