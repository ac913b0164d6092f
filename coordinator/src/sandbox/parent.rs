//! The coordinator's side: start a child, wait for it no longer than it may take, and say why it did not answer where it did not.

use super::{
    COMMAND, SandboxConfig,
    orders::{Answer, Orders, Work, receive, send},
};
use crate::{engine::ports::Pipeline, import::Imported, records::Problem};
use kiln_proto::{ids::SceneHash, options::ImportOptions, plan::Plan, scene::Scene, settings::BakeSettings};
use rustix::process::Signal;
use std::{
    io::{self, Read},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{Child, Command, ExitStatus, Stdio},
    thread::{self, sleep},
    time::{Duration, Instant},
};

/// How often a child is looked at: at first, and at most.
const LOOK: (Duration, Duration) = (Duration::from_millis(1), Duration::from_millis(20));
/// Bytes of a child's last words that are kept.
const WORDS: usize = 4_096;

/// The pipeline whose import and layout run in children; everything else works on what has passed them.
pub struct Sandbox {
    program: PathBuf,
    config: SandboxConfig,
}

impl Sandbox {
    /// Children are `program` with [`COMMAND`].
    #[must_use]
    pub fn new(program: PathBuf, config: SandboxConfig) -> Self {
        Self { program, config }
    }

    /// Has a child do some work, which is about `given`; its answer, and the bytes of what it made.
    fn order(&self, doing: &str, work: Work, given: Vec<u8>) -> Result<(Answer, Vec<u8>), Problem> {
        let orders = Orders { memory_bytes: self.config.memory_bytes, cpu_seconds: self.config.cpu_seconds, work };
        let ran = self.run(orders, given).map_err(|error| Problem::new(format!("{doing} could not be started: {error}")))?;
        match ran {
            Ran { ended: Ended::Alone(status), answer: Some(answer), .. } if status.success() => Ok(answer),
            Ran { ended, words, .. } => Err(self.why(doing, &ended, &words)),
        }
    }

    fn run(&self, orders: Orders, given: Vec<u8>) -> io::Result<Ran> {
        let mut command = Command::new(&self.program);
        command.arg(COMMAND).env_clear().stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = Guard(command.spawn()?);
        let (input, output, errors) = (child.0.stdin.take(), child.0.stdout.take(), child.0.stderr.take());
        // Beside the wait: a child that dies early closes its input, and one that talks much must not be held up.
        let telling = thread::spawn(move || input.map_or(Ok(()), |mut input| send(&mut input, &orders, &given)));
        let answering = thread::spawn(move || output.and_then(|mut output| receive(&mut output).ok()));
        let listening = thread::spawn(move || last_words(errors));
        let until = Instant::now() + Duration::from_secs(self.config.seconds);
        let mut pause = LOOK.0;
        let ended = loop {
            if let Some(status) = child.0.try_wait()? {
                break Ended::Alone(status);
            }
            if Instant::now() >= until {
                child.0.kill()?;
                child.0.wait()?;
                break Ended::Late;
            }
            sleep(pause);
            pause = (pause * 2).min(LOOK.1);
        };
        let _ = telling.join(); // What could not be told shows in the answer.
        Ok(Ran { ended, answer: answering.join().unwrap_or_default(), words: listening.join().unwrap_or_default() })
    }

    /// Why there is no answer.
    fn why(&self, doing: &str, ended: &Ended, words: &str) -> Problem {
        let SandboxConfig { memory_bytes, cpu_seconds, seconds } = self.config;
        let last = words.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
        Problem::new(match ended {
            Ended::Late => format!("{doing} took longer than {seconds} s (sandbox.seconds) and was stopped; make the scene smaller"),
            Ended::Alone(status) => match status.signal() {
                Some(signal) if signal == Signal::XCPU.as_raw() || signal == Signal::KILL.as_raw() => {
                    format!(
                        "{doing} took more than {cpu_seconds} s of processor time (sandbox.cpu_seconds) and was stopped; make the scene smaller"
                    )
                }
                Some(signal) if signal == Signal::ABORT.as_raw() && words.contains("memory allocation") => {
                    format!(
                        "{doing} took more than {memory_bytes} bytes of memory (sandbox.memory_bytes) and was stopped; make the scene smaller"
                    )
                }
                _ => format!("{doing} failed ({status}): {last}"),
            },
        })
    }
}

/// What became of a child.
struct Ran {
    ended: Ended,
    answer: Option<(Answer, Vec<u8>)>,
    words: String,
}

enum Ended {
    Alone(ExitStatus),
    /// It was killed.
    Late,
}

/// A child that does not outlive whoever waits for it.
struct Guard(Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn last_words(errors: Option<impl Read>) -> String {
    let (mut kept, mut block) = (Vec::new(), [0; WORDS]);
    if let Some(mut errors) = errors {
        while let Ok(n @ 1..) = errors.read(&mut block) {
            kept.extend_from_slice(&block[..n]);
            kept.drain(..kept.len().saturating_sub(WORDS));
        }
    }
    String::from_utf8_lossy(&kept).into_owned()
}

impl Pipeline for Sandbox {
    fn import(&self, files: Vec<(String, PathBuf)>, options: &ImportOptions, scratch: &Path) -> Result<Imported, Vec<Problem>> {
        const DOING: &str = "importing the scene";
        let work = Work::Import { files, options: options.clone(), scratch: scratch.to_owned() };
        match self.order(DOING, work, Vec::new()).map_err(|problem| vec![problem])? {
            (Answer::Imported { statistics, warnings }, bytes) => {
                let scene = Scene::from_bytes(&bytes).map_err(|e| vec![Problem::new(format!("{DOING}: {e}"))])?;
                Ok(Imported { scene, warnings, statistics: *statistics })
            }
            (Answer::Refused(problems), _) => Err(problems),
            (Answer::Planned { .. }, _) => Err(vec![Problem::new(format!("{DOING}: it made a plan"))]),
        }
    }

    fn plan(&self, scene: &Scene, hash: SceneHash, settings: &BakeSettings) -> Result<(Plan, Vec<Problem>), Problem> {
        const DOING: &str = "laying out the scene";
        let bytes = scene.to_bytes().map_err(|e| Problem::new(format!("{DOING} could not be started: {e}")))?;
        match self.order(DOING, Work::Plan { hash, settings: Box::new(settings.clone()) }, bytes)? {
            (Answer::Planned { warnings }, bytes) => {
                Ok((Plan::from_bytes(&bytes).map_err(|e| Problem::new(format!("{DOING}: {e}")))?, warnings))
            }
            (Answer::Refused(problems), _) => {
                Err(problems.into_iter().next().unwrap_or_else(|| Problem::new(format!("{DOING} was refused"))))
            }
            (Answer::Imported { .. }, _) => Err(Problem::new(format!("{DOING}: it made a scene"))),
        }
    }
}
