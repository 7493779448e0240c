//! How much of the campaign runs.

/// The number of cases: `full` where the environment variable `SPRINGPOT_CAMPAIGN` is `full`, otherwise `sample`.
pub fn cases(sample: u64, full: u64) -> u64 {
    if std::env::var_os("SPRINGPOT_CAMPAIGN").is_some_and(|scale| scale == "full") { full } else { sample }
}
