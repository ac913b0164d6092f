//! `kiln eval`: the bake's own estimator at points and directions that the user names.

use crate::{api, bake_settings::SettingsArgs, error::CommandError, import_args::ImportArgs, output, submit, work};
use clap::Args;
use glam::Vec3;
use kiln_coordinator::import;
use kiln_worker::{
    eval::{self, Answer, Query},
    scene::BakeScene,
    simd::Simd,
};
use std::{
    collections::HashMap,
    io::Write,
    path::{Path, PathBuf},
};

/// Outgoing radiance at given points toward given directions, with standard errors
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The scene
    scene: PathBuf,
    /// CSV with at least the columns surface, px, py, pz, dx, dy, dz; other columns are carried along
    queries: PathBuf,
    /// CSV to write; `-` for stdout
    #[arg(long, value_name = "FILE.csv")]
    out: PathBuf,
    /// Independent repetitions that the mean and its standard error are taken over
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65_536))]
    repeats: u32,
    /// Threads; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    import: ImportArgs,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// The columns that a query needs.
const NEEDED: [&str; 7] = ["surface", "px", "py", "pz", "dx", "dy", "dz"];
/// The columns that the answer writes; where the input has them, they are replaced.
const WRITTEN: [&str; 6] = ["r", "g", "b", "se_r", "se_g", "se_b"];

/// The queries of a file, with the columns that are carried along.
struct Table {
    header: Vec<String>,
    rows: Vec<Vec<String>>,
    queries: Vec<Query>,
}

/// Evaluates all queries.
pub fn run(args: &EvalArgs, json: bool) -> Result<(), CommandError> {
    // Opened before the work: a wrong folder must not cost it.
    let sink = open(&args.out)?;
    let settings = args.settings.patch()?.resolve().map_err(|e| CommandError::usage(format!("settings: {e}")))?;
    let table = read(&args.queries)?;
    let scratch = submit::scratch()?;
    let scene = submit::collect(&args.scene, &args.import, scratch.path())?;
    let imported = import::import_bundle(&scene.bundle, &scene.options).map_err(|p| api::rejected(&p))?;
    for warning in &imported.warnings {
        eprintln!("warning: {warning}");
    }
    let scene = BakeScene::new(imported.scene, Simd::Auto).map_err(|e| CommandError::from_error("the scene cannot be prepared", &e))?;
    let threads = if args.threads == 0 { work::cores() } else { args.threads };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| CommandError::from_error("cannot start threads", &e))?;
    let answers = pool.install(|| eval::evaluate(&scene, &table.queries, &settings, args.repeats));
    let answers: Vec<Answer> = answers
        .into_iter()
        .enumerate()
        .map(|(k, a)| a.map_err(|e| CommandError::from_error(format!("{}, query {}", args.queries.display(), k + 1), &e)))
        .collect::<Result<_, _>>()?;
    write(sink, &args.out, &table, &answers)?;
    if json && args.out.as_os_str() != "-" { output::json(&serde_json::json!({"queries": answers.len(), "out": args.out})) } else { Ok(()) }
}

fn read(path: &Path) -> Result<Table, CommandError> {
    let name = path.display();
    let mut reader = csv::Reader::from_path(path).map_err(|e| CommandError::work(format!("{name}: {e}")))?;
    let header: Vec<String> =
        reader.headers().map_err(|e| CommandError::work(format!("{name}: {e}")))?.iter().map(|h| h.trim().to_owned()).collect();
    let index: HashMap<&str, usize> = header.iter().enumerate().map(|(k, h)| (h.as_str(), k)).collect();
    let mut columns = [0; 7];
    for (column, needed) in columns.iter_mut().zip(NEEDED) {
        let missing = || CommandError::work(format!("{name}: no column `{needed}`; needed are {}", NEEDED.join(", ")));
        *column = *index.get(needed).ok_or_else(missing)?;
    }
    let (mut rows, mut queries) = (Vec::new(), Vec::new());
    for record in reader.records() {
        let record = record.map_err(|e| CommandError::work(format!("{name}: {e}")))?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |k: usize| {
            let text = record.get(columns[k]).unwrap_or_default().trim();
            let value = text.parse::<f32>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| {
                CommandError::work(format!("{name}:{line}: column `{}` has `{text}`, which is not a finite number", NEEDED[k]))
            })
        };
        let vector = |k: usize| Ok::<_, CommandError>(Vec3::new(number(k)?, number(k + 1)?, number(k + 2)?));
        let direction = vector(4)?;
        if direction.length_squared() == 0.0 {
            return Err(CommandError::work(format!("{name}:{line}: the direction is zero")));
        }
        let surface = record.get(columns[0]).unwrap_or_default().to_owned();
        queries.push(Query { surface, position: vector(1)?, direction: direction.normalize() });
        rows.push(record.iter().map(str::to_owned).collect());
    }
    Ok(Table { header, rows, queries })
}

fn open(path: &Path) -> Result<Box<dyn Write>, CommandError> {
    if path.as_os_str() == "-" {
        return Ok(Box::new(std::io::stdout().lock()));
    }
    Ok(Box::new(std::fs::File::create(path).map_err(|e| CommandError::work(format!("{}: {e}", path.display())))?))
}

fn write(sink: Box<dyn Write>, path: &Path, table: &Table, answers: &[Answer]) -> Result<(), CommandError> {
    let fail = |e: csv::Error| CommandError::work(format!("{}: {e}", path.display()));
    let mut writer = csv::Writer::from_writer(sink);
    let kept: Vec<usize> = (0..table.header.len()).filter(|k| !WRITTEN.contains(&table.header[*k].as_str())).collect();
    writer.write_record(kept.iter().map(|k| table.header[*k].as_str()).chain(WRITTEN)).map_err(fail)?;
    for (row, answer) in table.rows.iter().zip(answers) {
        let numbers: Vec<String> = answer.radiance.to_array().iter().chain(&answer.stderr.to_array()).map(f32::to_string).collect();
        let fields = kept.iter().map(|k| row[*k].as_str()).chain(numbers.iter().map(String::as_str));
        writer.write_record(fields).map_err(fail)?;
    }
    writer.flush().map_err(|e| CommandError::work(format!("{}: {e}", path.display())))
}
