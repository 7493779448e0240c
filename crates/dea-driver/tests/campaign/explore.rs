//! Exhaustive search with `stateright`: every state that a model reaches, each promise of docs/safety.md as an invariant of its name.

use std::hash::Hash;

use dea_driver::{Cause, DriverState};
use stateright::{Checker, HasDiscoveries, Model};

use crate::scale::is_full;

/// An enum `Promise` with the text of each, and `promises()`: an invariant for each, of a state whose field `broken` has the one that the step
/// to it broke.
macro_rules! promises {
    ($($promise:ident: $text:literal),* $(,)?) => {
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        enum Promise {
            $($promise),*
        }

        fn promises() -> Vec<stateright::Property<Search>> {
            vec![$(stateright::Property::always($text, |_, state: &<Search as stateright::Model>::State| state.broken != Some(Promise::$promise))),*]
        }
    };
}
pub(crate) use promises;

/// The result of a search that went on until no new state was found, or a broken promise.
pub fn searched<M>(model: M) -> impl Checker<M>
where
    M: Model<State: Clone + PartialEq + Hash + Send + Sync + 'static, Action: Clone + PartialEq>
        + Send
        + Sync
        + 'static,
{
    // One thread is first in breadth, and finds the shortest way.
    let threads = if is_full() { std::thread::available_parallelism().map_or(1, Into::into) } else { 1 };
    model.checker().finish_when(HasDiscoveries::AnyFailures).threads(threads).spawn_bfs().join()
}

/// The first of `promises` that does not hold.
pub fn first_broken<P: Copy>(promises: &[(bool, P)]) -> Result<(), P> {
    promises.iter().find(|(holds, _)| !holds).map_or(Ok(()), |&(_, promise)| Err(promise))
}

pub fn is_tripped(state: DriverState) -> bool {
    matches!(state, DriverState::Tripped(_))
}

/// Whether a trip before is the same trip after: a live film alone replaces its cause.
pub fn keeps_cause(before: DriverState, after: DriverState) -> bool {
    !is_tripped(before) || before == after || after == DriverState::Tripped(Cause::LiveFilm)
}
