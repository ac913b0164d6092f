//! Watching a job: bars on a terminal, a line now and then elsewhere, one JSON object an event for machines.

use crate::{api::Api, error::CommandError, output};
use futures_util::StreamExt;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use kiln_coordinator::records::{JobEvent, JobRecord, JobState};
use kiln_proto::ids::JobId;
use std::{
    io::IsTerminal,
    time::{Duration, Instant},
};

/// How often the bar is brought up to date.
const REFRESH: Duration = Duration::from_millis(400);
/// How often a line is printed where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(5);

/// Follows a job to its end on stderr; a coordinator that is away is waited for.
pub async fn follow(api: &Api, id: JobId) -> Result<JobRecord, CommandError> {
    let mut display = Display::new();
    loop {
        let job = api.job_patiently(id).await?;
        display.show(&job);
        if job.state.is_final() {
            return Ok(job);
        }
        tokio::time::sleep(REFRESH).await;
    }
}

/// Prints each event of a job on stdout as one line of JSON until the job has ended; connections that break are taken up again where
/// they broke.
pub async fn print_events(api: &Api, id: JobId) -> Result<JobRecord, CommandError> {
    let mut seq = 0;
    loop {
        // Asked first: when the job has ended before the stream, the stream that follows is complete.
        let job = api.job_patiently(id).await?;
        stream_events(api, id, &mut seq).await?;
        if job.state.is_final() {
            return Ok(job);
        }
        tokio::time::sleep(REFRESH).await;
    }
}

/// Prints what the stream says until it ends or breaks; only a stdout that cannot be written to is an error.
async fn stream_events(api: &Api, id: JobId, seq: &mut i64) -> Result<(), CommandError> {
    let Ok(response) = api.events(id, *seq).await else { return Ok(()) };
    let mut body = response.bytes_stream();
    let mut buffer = Vec::new();
    while let Some(Ok(piece)) = body.next().await {
        buffer.extend_from_slice(&piece);
        while let Some(end) = buffer.windows(2).position(|w| w == b"\n\n") {
            let event: Vec<u8> = buffer.drain(..end + 2).collect();
            let text = String::from_utf8_lossy(&event);
            for data in text.lines().filter_map(|l| l.strip_prefix("data:")) {
                print_event(data.trim(), seq)?;
            }
        }
    }
    Ok(())
}

fn print_event(data: &str, seq: &mut i64) -> Result<(), CommandError> {
    let position = serde_json::from_str::<JobEvent>(data).map(|event| event.seq).ok();
    if position.is_some_and(|p| p <= *seq) {
        return Ok(());
    }
    output::line(data)?;
    *seq = position.unwrap_or(*seq);
    Ok(())
}

/// A bar where someone looks, lines where someone may read later.
struct Display {
    bar: Option<ProgressBar>,
    stage: String,
    last_line: Option<Instant>,
}

impl Display {
    fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::with_draw_target(Some(1_000), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{prefix:>12} [{bar:36}] {msg}") {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Self { bar, stage: String::new(), last_line: None }
    }

    fn show(&mut self, job: &JobRecord) {
        let stage = stage(job);
        let message = message(job);
        match &self.bar {
            Some(bar) => {
                bar.set_prefix(stage.clone());
                bar.set_position((job.progress.fraction.clamp(0.0, 1.0) * 1_000.0) as u64);
                bar.set_message(message);
                if job.state.is_final() {
                    bar.finish();
                }
            }
            None => {
                let due = self.last_line.is_none_or(|t| t.elapsed() >= LINE_EVERY);
                if due || stage != self.stage {
                    if message.is_empty() {
                        eprintln!("{stage}");
                    } else {
                        eprintln!("{stage}: {message}");
                    }
                    self.last_line = Some(Instant::now());
                }
            }
        }
        self.stage = stage;
    }
}

fn stage(job: &JobRecord) -> String {
    match (job.state, job.phase) {
        (JobState::Baking, Some(phase)) => phase.to_string(),
        (state, _) => format!("{state:?}").to_lowercase(),
    }
}

fn message(job: &JobRecord) -> String {
    let p = &job.progress;
    if let Some(waiting) = &job.waiting {
        return waiting.clone();
    }
    if job.state != JobState::Baking {
        return String::new();
    }
    let eta = p.eta_seconds.map_or_else(|| "-".to_owned(), duration);
    format!(
        "{:>3.0} %  {}/{} tiles  {}rays/s  {} workers  ETA {eta}",
        p.fraction * 100.0,
        p.tiles_done,
        p.tiles,
        si(p.rays_per_second),
        p.workers
    )
}

/// Seconds as a person says them.
fn duration(seconds: f64) -> String {
    let s = seconds.max(0.0).round() as u64;
    match s {
        0..=99 => format!("{s} s"),
        100..=5_999 => format!("{}:{:02} min", s / 60, s % 60),
        _ => format!("{}:{:02} h", s / 3_600, s / 60 % 60),
    }
}

/// A number with k, M or G.
fn si(v: f64) -> String {
    match v {
        v if v >= 1e9 => format!("{:.1} G", v / 1e9),
        v if v >= 1e6 => format!("{:.1} M", v / 1e6),
        v if v >= 1e3 => format!("{:.0} k", v / 1e3),
        v => format!("{v:.0} "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_as_people_say_them() {
        assert_eq!([duration(7.4), duration(125.0), duration(7_300.0)], ["7 s", "2:05 min", "2:01 h"]);
        assert_eq!([si(12.0), si(4_400.0), si(2.5e6), si(3e9)], ["12 ", "4 k", "2.5 M", "3.0 G"]);
    }
}
