//! `kiln submit`: send scenes with all that they refer to.

use crate::{
    api::Api,
    bake,
    bake_settings::{SettingsArgs, word},
    error::CommandError,
    import_args::ImportArgs,
    output, progress,
    watch::ServerArgs,
};
use clap::Args;
use kiln_coordinator::{
    import::bundle::{self, Bundle},
    job::OnPoison,
    records::{JobRecord, NewJob},
};
use kiln_proto::options::ImportOptions;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// Send scenes to a coordinator and create a job for each
#[derive(Debug, Args)]
pub struct SubmitArgs {
    /// Scene files (.obj, .gltf, .glb, X3D or VRML97, or a .zip with one inside)
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    server: ServerArgs,
    /// Wait until the jobs are done
    #[arg(long)]
    wait: bool,
    /// Jobs of higher priority go first
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    priority: i32,
    /// The share of its tiles that two workers bake, so that their bytes can be compared, in [0, 1]; the service's own where nothing is said
    #[arg(long, value_name = "SHARE", value_parser = share)]
    verify: Option<f64>,
    /// A label for your own use; may be repeated
    #[arg(long, value_name = "KEY=VALUE", value_parser = label)]
    label: Vec<(String, String)>,
    /// Tell this address when a job is done, has failed or was cancelled; the service must allow it (`kiln serve --webhook-allow`)
    #[arg(long, value_name = "URL")]
    webhook: Option<String>,
    #[command(flatten)]
    poison: PoisonArgs,
    #[command(flatten)]
    import: ImportArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// What becomes of a job with a tile that nobody can bake.
#[derive(Debug, Clone, Copy, Args)]
pub struct PoisonArgs {
    /// What becomes of a job when one of its tiles is given up: fail (it can be tried again), or skip (it ends without the tile; the package
    /// lists such holes and fills them from beside)
    #[arg(long, value_name = "WHAT", value_parser = word::<OnPoison>, default_value = OnPoison::Fail.name())]
    pub on_poison: OnPoison,
}

/// A share in [0, 1].
pub fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| format!("`{text}`: expected a share between 0 and 1, such as 0.01"))
}

fn label(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or_else(|| format!("`{text}`: expected KEY=VALUE"))?;
    Ok((key.to_owned(), value.to_owned()))
}

/// Submits every scene.
pub async fn run(args: &SubmitArgs, json: bool) -> Result<(), CommandError> {
    let settings = args.settings.patch()?;
    let api = args.server.api()?;
    let scratch = scratch()?;
    let labels: BTreeMap<_, _> = args.label.iter().cloned().collect();
    for scene in &args.scenes {
        let scene = collect(scene, &args.import, scratch.path())?;
        let new = NewJob {
            scene: String::new(),
            settings: settings.clone(),
            priority: args.priority,
            labels: labels.clone(),
            verify: args.verify,
            webhook: args.webhook.clone(),
            on_poison: args.poison.on_poison,
        };
        let job = create(&api, &scene, new).await?;
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

/// Uploads a scene and creates `job` of it; warnings of the import go to stderr.
pub async fn create(api: &Api, scene: &Collected, job: NewJob) -> Result<JobRecord, CommandError> {
    let record = api.upload(&scene.bundle, &scene.options).await?;
    for warning in &record.warnings {
        eprintln!("warning: {warning}");
    }
    api.create_job(&NewJob { scene: record.id.to_string(), ..job }).await
}

/// A scene as it is on its way to an import.
pub struct Collected {
    /// Its files.
    pub bundle: Bundle,
    /// How it is to be read.
    pub options: ImportOptions,
}

/// A scene with every file that it refers to, and the environment. Archives are unpacked into `scratch`, which must outlive the result.
/// Files that are missing are listed on stderr; whether the scene can do without them is the importer's verdict.
pub fn collect(scene: &Path, import: &ImportArgs, scratch: &Path) -> Result<Collected, CommandError> {
    let (mut bundle, missing) = bundle::collect(scene, import.root(), scratch).map_err(|p| CommandError::work(p.to_string()))?;
    for problem in missing {
        eprintln!("warning: {problem}");
    }
    let options = import.pack(&mut bundle)?;
    Ok(Collected { bundle, options })
}

/// A folder for unpacked archives.
pub fn scratch() -> Result<tempfile::TempDir, CommandError> {
    tempfile::tempdir().map_err(|e| CommandError::from_error("cannot create a temporary folder", &e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        submit: SubmitArgs,
    }

    #[test]
    fn what_becomes_of_a_job_with_a_bad_tile_is_a_word_of_the_api() {
        let parse = |more: &[&str]| Line::try_parse_from([&["submit", "room.obj"], more].concat());
        let chosen = |more: &[&str]| parse(more).unwrap().submit.poison.on_poison;
        assert_eq!((chosen(&[]), chosen(&["--on-poison", "skip"])), (OnPoison::Fail, OnPoison::Skip));
        let refused = parse(&["--on-poison", "ignore"]).unwrap_err().to_string();
        assert!(refused.contains("`fail` or `skip`"), "{refused}");
    }
}
