//! `kiln bake`: the whole farm in one process tree. The same coordinator, worker and protocol as `serve`, over loopback, for one job.

use crate::{
    access_args::AccessArgs,
    api::Api,
    bake_settings::SettingsArgs,
    error::CommandError,
    fetch::{self, Content, OutputFolder},
    host::{Host, asked_to_stop},
    import_args::ImportArgs,
    output, progress,
    submit::{self, PoisonArgs},
};
use clap::Args;
use kiln_coordinator::{
    config::Config,
    records::{JobRecord, JobState, NewJob},
};
use kiln_proto::ids::JobId;
use std::path::{Path, PathBuf};

/// Bake scenes on this machine
#[derive(Debug, Args)]
pub struct BakeArgs {
    /// Scene files (.obj, .gltf, .glb, X3D or VRML97, or a .zip with one inside); each becomes one package
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folder for the package; with several scenes, a folder of packages
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Threads over all workers; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: u32,
    /// Worker processes to spread the threads over
    #[arg(long, value_name = "N", default_value_t = 1)]
    workers: u32,
    #[command(flatten)]
    content: Content,
    #[command(flatten)]
    poison: PoisonArgs,
    #[command(flatten)]
    import: ImportArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// Bakes every scene; the first that fails ends the command.
pub async fn run(args: &BakeArgs, json: bool) -> Result<(), CommandError> {
    let settings = args.settings.patch()?;
    args.content.check()?;
    let targets = targets(&args.scenes, &args.output)?;
    let scratch = submit::scratch()?;
    let bundles: Vec<_> = args.scenes.iter().map(|s| submit::collect(s, &args.import, scratch.path())).collect::<Result<_, _>>()?;
    for (_, target) in &targets {
        fetch::check_target(target)?;
    }
    let output = OutputFolder::create(&args.output)?;
    let data = output.scratch(".kiln-bake-")?;
    let host = Host::start(config(args, data.path()), false).await?;
    let api = Api::new(&host.url(), &AccessArgs::default())?;
    let mut delivered = Vec::new();
    let work = async {
        for ((scene, target), bundle) in targets.iter().zip(bundles) {
            let new = NewJob { settings: settings.clone(), on_poison: args.poison.on_poison, ..NewJob::default() };
            let job = submit::create(&api, &bundle, new).await.map_err(Failure::Bake)?;
            let done = progress::follow(&api, job.id).await.and_then(finished).map_err(Failure::Bake)?;
            fetch::deliver(&api, done.id, args.content, target).await.map_err(|e| Failure::Delivery(done.id, e))?;
            delivered.push(target.display().to_string());
            report(scene, args.content, target, &done, json).map_err(Failure::Bake)?;
        }
        Ok(())
    };
    let outcome = tokio::select! {
        outcome = work => outcome,
        () = asked_to_stop() => Err(Failure::Interrupted),
    };
    let stopped = host.stop().await;
    match outcome {
        Ok(()) => stopped,
        Err(Failure::Bake(error)) => Err(error),
        Err(Failure::Interrupted) if delivered.is_empty() => Err(CommandError::work("interrupted; nothing was written")),
        Err(Failure::Interrupted) => Err(CommandError::work(format!("interrupted; written before: {}", delivered.join(", ")))),
        Err(Failure::Delivery(job, error)) => {
            // Hours of work are not thrown away because the last copy failed.
            let kept = data.keep();
            let data = kept.display();
            Err(CommandError::work(format!(
                "{error}; the bake itself is safe: run `kiln serve --workers 0 --data {data}` and `kiln fetch {job} -o DIR`"
            )))
        }
    }
}

/// Why a bake ended early.
enum Failure {
    Bake(CommandError),
    /// The package is whole, but could not be brought to its folder.
    Delivery(JobId, CommandError),
    Interrupted,
}

fn config(args: &BakeArgs, data: &Path) -> Config {
    let workers = args.workers.max(1);
    let threads = if args.threads == 0 { crate::work::cores() as u32 } else { args.threads };
    Config {
        listen: ([127, 0, 0, 1], 0).into(),
        data_dir: data.to_owned(),
        workers,
        worker_threads: threads.div_ceil(workers).max(1),
        ..Config::default()
    }
}

fn targets(scenes: &[PathBuf], output: &Path) -> Result<Vec<(PathBuf, PathBuf)>, CommandError> {
    if let [scene] = scenes {
        return Ok(vec![(scene.clone(), output.to_owned())]);
    }
    let mut targets: Vec<(PathBuf, PathBuf)> = Vec::new();
    for scene in scenes {
        let stem = scene.file_stem().ok_or_else(|| CommandError::usage(format!("{} is not a file name", scene.display())))?;
        let target = output.join(stem);
        if let Some((other, _)) = targets.iter().find(|(_, t)| *t == target) {
            let (a, b) = (other.display(), scene.display());
            return Err(CommandError::usage(format!("{a} and {b} would both be baked to {}; bake them one at a time", target.display())));
        }
        targets.push((scene.clone(), target));
    }
    Ok(targets)
}

/// The job if it succeeded, its problem as an error if not. That it ended without some tiles is a warning on stderr.
pub fn finished(job: JobRecord) -> Result<JobRecord, CommandError> {
    match job.state {
        JobState::Done => {
            if job.holes > 0 {
                eprintln!(
                    "warning: job {} ended without {} of its {} tiles; `kiln inspect` lists the holes",
                    job.id, job.holes, job.progress.tiles
                );
            }
            Ok(job)
        }
        JobState::Cancelled => Err(CommandError::work(format!("job {} was cancelled", job.id))),
        _ => {
            let why = job.problem.map_or_else(|| "no reason was given".to_owned(), |p| p.to_string());
            Err(CommandError::work(format!("job {} failed: {why}", job.id)))
        }
    }
}

fn report(scene: &Path, content: Content, target: &Path, job: &JobRecord, json: bool) -> Result<(), CommandError> {
    if json {
        return output::json(&serde_json::json!({"scene": scene, "package": content.package_in(target), "job": job}));
    }
    output::line(&format!("{}", target.display()))?;
    content.explain(target);
    Ok(())
}
