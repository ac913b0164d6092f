//! The `kiln` command.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod decode;
mod encode;
mod inspect;
mod package;
mod table;

use clap::{Parser, Subcommand};
use std::{error::Error, process::ExitCode};

/// A distributed bake farm for lighting that depends on the viewer.
#[derive(Parser)]
struct Cli {
    /// Report in JSON.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Inspect(inspect::Args),
    Encode(encode::Args),
    Decode(decode::Args),
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let mut out = std::io::stdout().lock();
    let result = match &cli.command {
        Command::Inspect(args) => inspect::run(args, cli.json, &mut out),
        Command::Encode(args) => encode::run(args, cli.json, &mut out),
        Command::Decode(args) => decode::run(args, cli.json, &mut out),
    };
    let Err(error) = result else { return ExitCode::SUCCESS };
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(next) = cause {
        text += &format!(": {next}");
        cause = next.source();
    }
    eprintln!("kiln: {text}");
    ExitCode::from(error.exit_code())
}
