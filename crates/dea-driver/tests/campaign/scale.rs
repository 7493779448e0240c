//! How many cases the campaign runs: a sample by default, all of them if `SPRINGPOT_CAMPAIGN=full` is set.

/// Whether all cases run.
pub fn is_full() -> bool {
    std::env::var_os("SPRINGPOT_CAMPAIGN").is_some_and(|value| value == "full")
}

/// The number of cases: `sample` or `full`.
pub fn cases(sample: u64, full: u64) -> u64 {
    if is_full() { full } else { sample }
}
