//! Every state that can be reached, by a breadth-first search.

use std::collections::{HashSet, VecDeque};
use std::fmt::Debug;

/// Subject of a search.
pub trait World: Clone {
    type Step: Copy + Debug;

    /// Takes a step; a text where it breaks a promise.
    fn step(&mut self, step: Self::Step) -> Result<(), String>;

    /// Hash that identifies a state. Its 64 bits coincide for two of a million states with a probability of 3e-8.
    fn key(&self) -> u64;
}

/// Takes every one of `steps` in every state once, and returns the number of states; a violation with the steps that lead to it.
pub fn explore<W: World>(
    start: W,
    steps: &[W::Step],
    mut visit: impl FnMut(&W),
) -> Result<usize, (String, Vec<W::Step>)> {
    let mut seen = HashSet::from([start.key()]);
    // Where each state came from, in the order in which they were found.
    let mut origins: Vec<(usize, Option<W::Step>)> = vec![(0, None)];
    let mut queue = VecDeque::from([(start, 0)]);
    while let Some((world, index)) = queue.pop_front() {
        visit(&world);
        for &step in steps {
            let mut next = world.clone();
            if let Err(violation) = next.step(step) {
                let before = std::iter::successors(Some(origins[index]), |&(at, step)| step.map(|_| origins[at]));
                let mut path: Vec<W::Step> = before.filter_map(|(_, step)| step).collect();
                path.reverse();
                path.push(step);
                return Err((violation, path));
            }
            if seen.insert(next.key()) {
                queue.push_back((next, origins.len()));
                origins.push((index, Some(step)));
            }
        }
    }
    Ok(origins.len())
}
