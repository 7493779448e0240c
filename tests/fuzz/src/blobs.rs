//! Parameter blobs and the flash that keeps them.
#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    fuzz_targets::blobs(data);
});
