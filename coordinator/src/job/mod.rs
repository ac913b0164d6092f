//! The life of a job: pure states and one function that says what is legal.

mod state;
mod transition;
mod why;

#[cfg(test)]
mod tests;

pub use state::{Job, JobTask, OnPoison, Retry};
pub use transition::{Action, Event, Illegal, apply};
pub use why::{Ahead, Facts, why};
