//! Errors as people read them: one line from the effect to its first cause.

use std::error::Error;

/// An error with its causes in one line. A cause that its effect already quotes is not repeated.
#[must_use]
pub fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let more = inner.to_string();
        if !text.contains(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = inner.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{0}")]
    struct Layer(&'static str, #[source] Option<Box<Layer>>);

    #[test]
    fn causes_follow_their_effects_and_nothing_is_said_twice() {
        let error = Layer("no file", None);
        let error = Layer("cannot open a.obj: no file", Some(Box::new(error)));
        assert_eq!(chain(&Layer("the import failed", Some(Box::new(error)))), "the import failed: cannot open a.obj: no file");
    }
}
