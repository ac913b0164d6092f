//! `kiln config check`: what a configuration comes to, or everything that is wrong with it.

use crate::{error::CommandError, output, serve::read_config};
use clap::{Args, Subcommand};
use kiln_coordinator::config::Config;
use std::path::PathBuf;

/// Look at configuration
#[derive(Debug, Args)]
pub struct ConfigArgs {
    #[command(subcommand)]
    command: ConfigCommand,
}

#[derive(Debug, Subcommand)]
enum ConfigCommand {
    /// Check a configuration file and print what it comes to, defaults included
    Check {
        /// The file; without one, the defaults are printed
        #[arg(long, value_name = "FILE.toml", env = "KILN_CONFIG")]
        config: Option<PathBuf>,
    },
}

/// Checks and prints.
pub fn run(args: &ConfigArgs, json: bool) -> Result<(), CommandError> {
    let ConfigCommand::Check { config } = &args.command;
    let config = config.as_deref().map_or_else(|| Ok(Config::default()), read_config)?;
    if json {
        return output::json(&config);
    }
    let text = toml::to_string(&config).map_err(|e| CommandError::from_error("cannot print the configuration", &e))?;
    output::line(text.trim_end())
}
