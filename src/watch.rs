//! `kiln watch`, `kiln cancel`, `kiln jobs`: what goes on at a coordinator.

use crate::{access_args::AccessArgs, api::Api, bake, error::CommandError, output, progress};
use clap::Args;
use kiln_coordinator::records::JobChange;
use kiln_proto::ids::JobId;

/// Where the coordinator is.
#[derive(Debug, Args)]
pub struct ServerArgs {
    /// The coordinator's address
    #[arg(long, value_name = "URL", env = "KILN_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    #[command(flatten)]
    access: AccessArgs,
}

impl ServerArgs {
    /// A client of it.
    pub fn api(&self) -> Result<Api, CommandError> {
        Api::new(&self.server, &self.access)
    }
}

/// Follow a job until it has ended
#[derive(Debug, Args)]
pub struct WatchArgs {
    /// The job
    id: JobId,
    #[command(flatten)]
    server: ServerArgs,
}

/// One job
#[derive(Debug, Args)]
pub struct JobArgs {
    /// The job
    id: JobId,
    #[command(flatten)]
    server: ServerArgs,
}

/// List jobs
#[derive(Debug, Args)]
pub struct JobsArgs {
    /// Only jobs in this state: queued, preparing, baking, paused, assembling, done, failed or cancelled
    #[arg(long)]
    state: Option<String>,
    /// Only jobs with this label
    #[arg(long, value_name = "KEY=VALUE")]
    label: Option<String>,
    #[command(flatten)]
    server: ServerArgs,
}

/// Follows a job; a job that fails is a failed command.
pub async fn watch(args: &WatchArgs, json: bool) -> Result<(), CommandError> {
    let api = args.server.api()?;
    let job = if json { progress::print_events(&api, args.id).await? } else { progress::follow(&api, args.id).await? };
    bake::finished(job).map(|_| ())
}

/// Cancels a job.
pub async fn cancel(args: &JobArgs, json: bool) -> Result<(), CommandError> {
    let job = args.server.api()?.cancel(args.id).await?;
    if json { output::json(&job) } else { output::line(&format!("{} {}", job.id, state(&job))) }
}

/// Pauses a job, or lets it go on.
pub async fn pause(args: &JobArgs, paused: bool, json: bool) -> Result<(), CommandError> {
    let job = args.server.api()?.change(args.id, &JobChange { paused: Some(paused), priority: None }).await?;
    if json { output::json(&job) } else { output::line(&format!("{} {}", job.id, state(&job))) }
}

/// Tries the tiles of a failed job again that were given up.
pub async fn retry(args: &JobArgs, json: bool) -> Result<(), CommandError> {
    let job = args.server.api()?.retry(args.id).await?;
    if json { output::json(&job) } else { output::line(&format!("{} {}", job.id, state(&job))) }
}

/// Lists jobs, newest first.
pub async fn jobs(args: &JobsArgs, json: bool) -> Result<(), CommandError> {
    let api = args.server.api()?;
    let jobs = api.jobs(args.state.as_deref(), args.label.as_deref()).await?;
    if json {
        return output::json(&jobs);
    }
    if jobs.is_empty() && args.state.is_none() && args.label.is_none() {
        eprintln!("no jobs at {}; {} workers are connected", api.base(), api.workers().await?.len());
    }
    for job in &jobs {
        let percent = format!("{:.0} %", job.progress.fraction * 100.0);
        let labels: Vec<String> = job.labels.iter().map(|(k, v)| format!("{k}={v}")).collect();
        output::line(&format!("{}  {:<10}  {percent:>5}  {:>9} texels  {}", job.id, state(job), job.progress.texels, labels.join(" ")))?;
    }
    Ok(())
}

fn state(job: &kiln_coordinator::records::JobRecord) -> String {
    format!("{:?}", job.state).to_lowercase()
}
