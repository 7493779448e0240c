//! Smaller models with the same response.

use springpot::{Maxwell, ModelError, Springpot};

/// The same model with the more elastic springpot of every branch first, and branches from fast to slow.
///
/// # Errors
///
/// [`ModelError`] never, of a model that was valid.
pub fn ordered(model: &Maxwell) -> Result<Maxwell, ModelError> {
    let mut branches: Vec<[Springpot; 2]> = model.branches().to_vec();
    for pair in &mut branches {
        pair.sort_by(|a, b| a.alpha.total_cmp(&b.alpha));
    }
    branches.sort_by(|a, b| relaxation_time(a).total_cmp(&relaxation_time(b)));
    Maxwell::new(model.main(), &branches, model.topology(), model.mass_kg())
}

/// Time (s) at which both springpots of a branch are equally stiff; infinite for equal orders.
pub fn relaxation_time([first, second]: &[Springpot; 2]) -> f64 {
    let order = second.alpha - first.alpha;
    if order == 0.0 { f64::INFINITY } else { ((second.c / first.c).ln() / order).exp() }
}
