//! What the tests share.

pub mod defining_sum;
pub mod full_memory;
pub mod models;

/// Whether sweeps run at their full width: `SPRINGPOT_SWEEP=full`.
///
/// # Panics
///
/// For any other value, which was meant to ask for something.
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
pub fn sample<T>(cases: Vec<T>, count: usize) -> Vec<T> {
    if full_sweep() {
        return cases;
    }
    let total = cases.len();
    // Case k is taken where count · k / total rises.
    cases.into_iter().enumerate().filter(|(k, _)| (k * count) % total < count).map(|(_, case)| case).collect()
}

/// RMS of the difference of two series over the standard deviation of the second.
pub fn relative_rms(series: &[f64], reference: &[f64]) -> f64 {
    assert_eq!(series.len(), reference.len());
    let mean = reference.iter().sum::<f64>() / reference.len() as f64;
    let spread: f64 = reference.iter().map(|y| (y - mean).powi(2)).sum();
    let difference: f64 = series.iter().zip(reference).map(|(x, y)| (x - y).powi(2)).sum();
    (difference / spread).sqrt()
}
