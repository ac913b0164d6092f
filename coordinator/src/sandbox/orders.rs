//! What the child is told, and what it answers: a message, and the bytes of a scene or a plan behind it. All of it goes through pipes, so that
//! a full disk is nobody's business here.

use crate::records::{Problem, SceneStatistics};
use kiln_proto::{ids::SceneHash, options::ImportOptions, settings::BakeSettings};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::{
    io::{self, Read, Write},
    path::PathBuf,
};

/// One piece of work.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Orders {
    /// Address space that it may take, bytes.
    pub(super) memory_bytes: u64,
    /// Processor time that it may take, seconds.
    pub(super) cpu_seconds: u64,
    /// What to do.
    pub(super) work: Work,
}

/// What to do.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Work {
    /// Import an upload.
    Import {
        /// The client's names, and where the bytes are.
        files: Vec<(String, PathBuf)>,
        /// How to read it.
        options: ImportOptions,
        /// A folder for what an archive unpacks to.
        scratch: PathBuf,
    },
    /// Lay out and cut the scene whose canonical bytes follow.
    Plan {
        /// Its hash.
        hash: SceneHash,
        /// The job's settings.
        settings: Box<BakeSettings>,
    },
}

/// What came of it.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The canonical scene follows.
    Imported {
        /// Its counts.
        statistics: Box<SceneStatistics>,
        /// What was repaired, ignored or approximated.
        warnings: Vec<Problem>,
    },
    /// The plan follows.
    Planned {
        /// What was bounded or replaced.
        warnings: Vec<Problem>,
    },
    /// It cannot be done.
    Refused(Vec<Problem>),
}

/// Writes a message and the bytes behind it.
pub(super) fn send(to: &mut impl Write, message: &impl Serialize, bytes: &[u8]) -> io::Result<()> {
    let text = serde_json::to_vec(message)?;
    to.write_all(&(text.len() as u64).to_le_bytes())?;
    to.write_all(&text)?;
    to.write_all(bytes)?;
    to.flush()
}

/// Reads a message and the bytes behind it, to the end.
pub(super) fn receive<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<(T, Vec<u8>)> {
    let mut length = [0; 8];
    from.read_exact(&mut length)?;
    let mut text = Vec::new();
    let length = u64::from_le_bytes(length);
    if from.by_ref().take(length).read_to_end(&mut text)? as u64 != length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let mut bytes = Vec::new();
    from.read_to_end(&mut bytes)?;
    Ok((serde_json::from_slice(&text)?, bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_arrive_whole_or_not_at_all() {
        let mut pipe = Vec::new();
        let problem = Problem::new("no");
        send(&mut pipe, &Answer::Refused(vec![problem.clone()]), b"rest").unwrap();
        let (answer, bytes) = receive::<Answer>(&mut pipe.as_slice()).unwrap();
        assert!(matches!(answer, Answer::Refused(problems) if problems == [problem]));
        assert_eq!(bytes, b"rest");
        assert!((0..pipe.len() - 4).all(|n| receive::<Answer>(&mut &pipe[..n]).is_err()));
    }
}
