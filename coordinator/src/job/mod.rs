//! The life of a job: pure states and one function that says what is legal.

mod state;
mod transition;

#[cfg(test)]
mod tests;

pub use state::{Job, JobTask};
pub use transition::{Action, Event, Illegal, apply};
