//! The link: bytes from the line, and requests in frames that hold.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    fuzz_targets::frames(data);
});
