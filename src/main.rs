//! `kiln`: the composition root. The only code that sees both the coordinator and the worker; one file a subcommand.
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]
#![allow(unreachable_pub)] // A binary has no public interface; `pub` here only joins the files of the command line.

mod access_args;
mod api;
mod bake;
mod bake_settings;
mod children;
mod config;
mod convert;
mod decode;
mod encode;
mod error;
mod eval;
mod fetch;
mod host;
mod import_args;
mod inspect;
mod output;
mod package;
mod progress;
mod render;
mod serve;
mod submit;
mod table;
mod telemetry;
mod token;
mod view;
mod viewer;
mod watch;
mod work;

use clap::{Parser, Subcommand};
use error::CommandError;
use package::ToolError;
use std::process::ExitCode;

/// Kiln bakes lighting that depends on the viewer.
///
/// Exit codes: 0 done, 1 the work failed, 2 the command was not understood. Progress and messages go to stderr, results to stdout.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print results as JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(flatten)]
    telemetry: telemetry::TelemetryArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    Bake(bake::BakeArgs),
    Serve(serve::ServeArgs),
    Work(work::WorkArgs),
    Submit(submit::SubmitArgs),
    Watch(watch::WatchArgs),
    Fetch(fetch::FetchArgs),
    /// Cancel a job
    Cancel(watch::JobArgs),
    /// Lease nothing more of a job until it is resumed; what is leased still counts
    Pause(watch::JobArgs),
    /// Let a paused job go on
    Resume(watch::JobArgs),
    /// Try the tiles of a failed job again that were given up
    Retry(watch::JobArgs),
    Jobs(watch::JobsArgs),
    View(view::ViewArgs),
    Inspect(inspect::Args),
    Encode(encode::Args),
    Decode(decode::Args),
    Eval(eval::EvalArgs),
    Render(render::Args),
    Convert(convert::ConvertArgs),
    Config(config::ConfigArgs),
    /// What a coordinator starts to import and lay out scenes
    #[command(name = kiln_coordinator::sandbox::COMMAND, hide = true)]
    Sandbox,
    Token(token::TokenArgs),
}

fn main() -> ExitCode {
    kiln_coordinator::crypto::choose();
    let cli = Cli::parse();
    let (service, log) = match cli.command {
        Command::Serve(_) => ("kiln-coordinator", "warn,kiln::audit=info"),
        Command::Work(_) => ("kiln-worker", "warn"),
        _ => ("kiln", "warn"),
    };
    let _telemetry = match cli.telemetry.start(service, log) {
        Ok(telemetry) => telemetry,
        Err(error) => return fail(&error),
    };
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => fail(&error),
    }
}

fn fail(error: &CommandError) -> ExitCode {
    eprintln!("error: {error}");
    ExitCode::from(error.exit_code())
}

fn run(cli: &Cli) -> Result<(), CommandError> {
    let json = cli.json;
    match &cli.command {
        Command::Inspect(args) => tool(inspect::run(args, json, &mut std::io::stdout().lock())),
        Command::Encode(args) => tool(encode::run(args, json, &mut std::io::stdout().lock())),
        Command::Decode(args) => tool(decode::run(args, json, &mut std::io::stdout().lock())),
        Command::Render(args) => tool(render::run(args, json, &mut std::io::stdout().lock())),
        Command::Eval(args) => eval::run(args, json),
        Command::Convert(args) => convert::run(args, json),
        Command::Config(args) => config::run(args, json),
        Command::Sandbox => {
            let outcome = kiln_coordinator::sandbox::child::run(std::io::stdin().lock(), std::io::stdout().lock());
            outcome.map_err(|e| CommandError::from_error("the sandbox", &e))
        }
        networked => {
            let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
            let runtime = runtime.map_err(|e| CommandError::from_error("cannot start the runtime", &e))?;
            runtime.block_on(run_networked(networked, json))
        }
    }
}

fn tool(outcome: Result<(), ToolError>) -> Result<(), CommandError> {
    outcome.map_err(|e| if e.is_usage() { CommandError::usage(kiln_proto::chain(&e)) } else { CommandError::work(kiln_proto::chain(&e)) })
}

async fn run_networked(command: &Command, json: bool) -> Result<(), CommandError> {
    match command {
        Command::Bake(args) => bake::run(args, json).await,
        Command::Serve(args) => serve::run(args, json).await,
        Command::Work(args) => work::run(args).await,
        Command::Submit(args) => submit::run(args, json).await,
        Command::Watch(args) => watch::watch(args, json).await,
        Command::Fetch(args) => fetch::run(args, json).await,
        Command::View(args) => view::run(args, json).await,
        Command::Cancel(args) => watch::cancel(args, json).await,
        Command::Pause(args) => watch::pause(args, true, json).await,
        Command::Resume(args) => watch::pause(args, false, json).await,
        Command::Retry(args) => watch::retry(args, json).await,
        Command::Jobs(args) => watch::jobs(args, json).await,
        Command::Token(args) => token::run(args, json).await,
        Command::Inspect(_)
        | Command::Encode(_)
        | Command::Decode(_)
        | Command::Render(_)
        | Command::Eval(_)
        | Command::Convert(_)
        | Command::Config(_)
        | Command::Sandbox => Err(CommandError::usage("this command does not talk to a coordinator")),
    }
}
