//! What a command prints on stdout. Progress and messages go to stderr, so that stdout can be piped.

use crate::error::CommandError;
use serde::Serialize;
use std::io::Write;

/// One line of text.
pub fn line(text: &str) -> Result<(), CommandError> {
    write_out(text)
}

/// One line of JSON.
pub fn json<T: Serialize>(value: &T) -> Result<(), CommandError> {
    let text = serde_json::to_string(value).map_err(|e| CommandError::from_error("cannot write JSON", &e))?;
    write_out(&text)
}

fn write_out(text: &str) -> Result<(), CommandError> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        // A reader that has seen enough (`| head`) is not a failure.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| CommandError::from_error("cannot write to stdout", &e)),
    }
}
