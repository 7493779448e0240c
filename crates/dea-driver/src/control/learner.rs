//! Learning of periodic references within the tick.

use springpot::{Learning, LearningState, SensorSample, VoltageCommand};

/// A [`Learning`] and what it has learned, through runs.
#[derive(Clone, Debug)]
pub(crate) struct Learner {
    learning: Learning<f32>,
    state: LearningState<f32>,
    /// Whether the command before met no limit.
    is_free: bool,
    /// Whether the next run begins with what this one has learned.
    carries_over: bool,
    /// Whether this run has had a reference.
    has_begun: bool,
}

impl Learner {
    pub(crate) fn new(learning: Learning<f32>) -> Self {
        let state = learning.state(0.0);
        Self { learning, state, is_free: true, carries_over: false, has_begun: false }
    }

    /// What it learns by.
    #[cfg(feature = "loop-test")]
    pub(crate) fn learning(&self) -> &Learning<f32> {
        &self.learning
    }

    /// The reference (m) to follow instead of `reference` (m), from a `sample` if one is due.
    pub(crate) fn advance(&mut self, reference: f32, sample: Option<SensorSample<f32>>) -> f32 {
        if !self.has_begun {
            self.begin(reference);
        }
        self.learning.advance(&mut self.state, reference, sample, self.is_free)
    }

    /// Begins a run at `reference` (m). Not inlined: a tick would need the stack for it.
    #[inline(never)]
    fn begin(&mut self, reference: f32) {
        self.has_begun = true;
        self.is_free = true;
        self.state = if self.carries_over {
            self.learning.carried_over(&self.state, reference)
        } else {
            self.learning.state(reference)
        };
        self.carries_over = false;
    }

    /// Takes note of the limits that a command met.
    pub(crate) fn commanded(&mut self, command: &VoltageCommand<f32>) {
        self.is_free = command.limited.is_none();
    }

    /// What is added to the reference now, m.
    pub(crate) fn added_m(&self) -> f32 {
        if self.has_begun { self.state.added() } else { 0.0 }
    }

    /// Whether the errors of the present cycles have been seen.
    pub(crate) fn has_learned(&self) -> bool {
        self.has_begun && self.state.has_learned()
    }

    /// Ends a run.
    pub(crate) fn end_run(&mut self) {
        self.has_begun = false;
    }

    /// Keeps what was learned for the next run.
    pub(crate) fn carry_over(&mut self) {
        self.carries_over = true;
    }

    /// Forgets what was learned. What a run adds fades out.
    pub(crate) fn forget(&mut self) {
        self.state.forget();
        self.carries_over = false;
    }
}
