//! How many cases the campaign runs: a sample by default, all of them if `SPRINGPOT_CAMPAIGN=full` is set.

/// Whether all cases run.
pub fn is_full() -> bool {
    std::env::var_os("SPRINGPOT_CAMPAIGN").is_some_and(|value| value == "full")
}

/// The number of cases: `sample` or `full`.
pub fn cases(sample: u64, full: u64) -> u64 {
    if is_full() { full } else { sample }
}

/// A count in groups of three digits.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut grouped = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            grouped.push(' ');
        }
        grouped.push(digit);
    }
    grouped
}
