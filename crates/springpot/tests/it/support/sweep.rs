//! How wide sweeps run: a sample by default, all cases with `SPRINGPOT_SWEEP=full`. Shared with the workspace's own tests.

/// Whether sweeps run at their full width: `SPRINGPOT_SWEEP=full`.
///
/// # Panics
///
/// For any other value, which was meant to ask for something.
#[must_use]
pub fn full_sweep() -> bool {
    match std::env::var("SPRINGPOT_SWEEP") {
        Ok(width) => {
            assert_eq!(width, "full", "SPRINGPOT_SWEEP");
            true
        }
        Err(_) => false,
    }
}

/// All `cases` in a full sweep, otherwise `count` of them, evenly spread.
#[must_use]
pub fn sample<T>(cases: Vec<T>, count: usize) -> Vec<T> {
    if full_sweep() {
        return cases;
    }
    let total = cases.len();
    // Case k is taken where count · k / total rises.
    cases.into_iter().enumerate().filter(|(k, _)| (k * count) % total < count).map(|(_, case)| case).collect()
}
