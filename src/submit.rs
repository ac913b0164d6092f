//! `kiln submit`: send scenes with all that they refer to.

use crate::{
    api::{Api, BundleFile},
    bake,
    bake_settings::SettingsArgs,
    error::CommandError,
    output, progress,
};
use clap::Args;
use kiln_coordinator::{
    import::bundle,
    records::{JobRecord, NewJob},
};
use kiln_proto::settings::SettingsPatch;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// Send scenes to a coordinator and create a job for each
#[derive(Debug, Args)]
pub struct SubmitArgs {
    /// Scene files (.obj, or a .zip with one inside)
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// The coordinator's address
    #[arg(long, value_name = "URL", env = "KILN_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Wait until the jobs are done
    #[arg(long)]
    wait: bool,
    /// Jobs of higher priority go first
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    priority: i32,
    /// A label for your own use; may be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = label)]
    label: Vec<(String, String)>,
    #[command(flatten)]
    settings: SettingsArgs,
}

fn label(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or_else(|| format!("`{text}`: expected KEY=VALUE"))?;
    Ok((key.to_owned(), value.to_owned()))
}

/// Submits every scene.
pub async fn run(args: &SubmitArgs, json: bool) -> Result<(), CommandError> {
    let settings = args.settings.patch()?;
    let api = Api::new(&args.server)?;
    let labels: BTreeMap<_, _> = args.label.iter().cloned().collect();
    for scene in &args.scenes {
        let files = collect(scene)?;
        let job = create(&api, &files, settings.clone(), args.priority, labels.clone()).await?;
        if json {
            output::json(&serde_json::json!({"id": job.id}))?;
        } else {
            output::line(&job.id.to_string())?;
        }
        if args.wait {
            bake::finished(progress::follow(&api, job.id).await?)?;
        }
    }
    Ok(())
}

/// Uploads a scene and creates its job; warnings of the import go to stderr.
pub async fn create(
    api: &Api,
    files: &[BundleFile],
    settings: SettingsPatch,
    priority: i32,
    labels: BTreeMap<String, String>,
) -> Result<JobRecord, CommandError> {
    let record = api.upload(files).await?;
    for warning in &record.warnings {
        eprintln!("warning: {warning}");
    }
    api.create_job(&NewJob { scene: record.id.to_string(), settings, priority, labels }).await
}

/// The scene and every file that it refers to, with their paths relative to the scene's folder.
pub fn collect(scene: &Path) -> Result<Vec<BundleFile>, CommandError> {
    let found = bundle::collect(scene).map_err(|problems| {
        let list: Vec<String> = problems.iter().map(|p| format!("\n  {p}")).collect();
        CommandError::work(format!("{} cannot be submitted:{}", scene.display(), list.concat()))
    })?;
    Ok(found.into_iter().map(|(name, path)| BundleFile { name, path }).collect())
}
