//! `kiln token`: who may use a service. It works on the database, whether the service runs or not; a running one follows within seconds.

use crate::{error::CommandError, output, serve::read_config, table::Table};
use clap::{Args, Subcommand};
use kiln_coordinator::{
    auth::{Desk, DeskError, Minted, Role, Roles, TokenId, TokenRow},
    config::Config,
};
use kiln_proto::chain;
use serde_json::json;
use std::{
    path::PathBuf,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

/// Make, list and take back access tokens
#[derive(Debug, Args)]
pub struct TokenArgs {
    #[command(subcommand)]
    command: TokenCommand,
    /// The service's data folder [default: kiln-data]
    #[arg(long, env = "KILN_DATA", global = true)]
    data: Option<PathBuf>,
    /// The service's database, where it is not in the data folder: postgres://USER:PASSWORD@HOST/DATABASE
    #[arg(long, value_name = "URL", env = "KILN_STORE", hide_env_values = true, global = true)]
    store: Option<String>,
    /// The service's configuration file, which may name either
    #[arg(long, value_name = "FILE.toml", env = "KILN_CONFIG", global = true)]
    config: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum TokenCommand {
    /// Make a token, and print it: the only time it is shown. From the first token on, the service asks everyone for one
    Create {
        /// What to call it in lists
        #[arg(long)]
        name: String,
        /// What it is for: submit, read, worker or admin; may be repeated
        #[arg(long = "role", value_name = "ROLE", required = true)]
        roles: Vec<Role>,
        /// How long it is good for, such as 12h, 30d or 8w; for ever where nothing is said
        #[arg(long, value_name = "TIME", value_parser = duration)]
        expires: Option<Duration>,
    },
    /// List all tokens that were ever made
    List,
    /// Give a token a new secret, and print it; the old one ends, and what the token owns stays its own
    Rotate {
        /// The token's id
        id: String,
    },
    /// Take a token back, for ever
    Revoke {
        /// The token's id
        id: String,
    },
}

/// A time as people write it: a number with its unit.
pub fn duration(text: &str) -> Result<Duration, String> {
    let wrong = || format!("`{text}`: expected a number with m, h, d or w behind it, such as 30d");
    let unit = match text.chars().last() {
        Some('m') => 60,
        Some('h') => 3_600,
        Some('d') => 86_400,
        Some('w') => 7 * 86_400,
        _ => return Err(wrong()),
    };
    let count: u32 = text[..text.len() - 1].parse().map_err(|_| wrong())?;
    Ok(Duration::from_secs(u64::from(count) * unit))
}

/// The id in a text. Parsed here and not by clap, which would repeat what it was given: it may be a whole token.
fn id(text: &str) -> Result<TokenId, CommandError> {
    text.parse().map_err(|e| CommandError::usage(chain(&e)))
}

/// Does what the command says.
pub async fn run(args: &TokenArgs, as_json: bool) -> Result<(), CommandError> {
    let mut config = args.config.as_deref().map_or_else(|| Ok(Config::default()), read_config)?;
    config.data_dir = args.data.clone().unwrap_or(config.data_dir);
    config.store = args.store.clone().or(config.store);
    let desk = Desk::open(&config).await.map_err(|e| failed(&e))?;
    let now = now();
    match &args.command {
        TokenCommand::Create { name, roles, expires } => {
            let expires = expires.map(|length| now + length.as_millis() as i64);
            let minted = desk.create(name, Roles::of(roles), expires, now).await.map_err(|e| failed(&e))?;
            show(&minted, as_json)
        }
        TokenCommand::Rotate { id } => show(&desk.rotate(self::id(id)?).await.map_err(|e| failed(&e))?, as_json),
        TokenCommand::Revoke { id } => {
            let id = self::id(id)?;
            desk.revoke(id, now).await.map_err(|e| failed(&e))?;
            if as_json { output::json(&json!({"id": id, "revoked_ms": now})) } else { output::line(&format!("{id} revoked")) }
        }
        TokenCommand::List => list(&desk.list().await.map_err(|e| failed(&e))?, now, as_json),
    }
}

fn failed(error: &DeskError) -> CommandError {
    CommandError::work(chain(error))
}

fn now() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_millis() as i64)
}

/// The token alone on stdout, so that it can be piped to where it is kept.
fn show(Minted { row, text }: &Minted, as_json: bool) -> Result<(), CommandError> {
    if as_json {
        return output::json(&json!({"id": row.id, "token": text.expose(), "roles": row.roles, "expires_ms": row.expires_ms}));
    }
    eprintln!("token {} of {} ({}); it is shown this once, keep it where only its user can read it:", row.id, row.name, row.roles);
    output::line(text.expose())
}

fn list(rows: &[TokenRow], now: i64, as_json: bool) -> Result<(), CommandError> {
    if as_json {
        return output::json(&rows);
    }
    if rows.is_empty() {
        eprintln!("no token was made yet; `kiln token create --name NAME --role ROLE` makes one");
        return Ok(());
    }
    let mut table = Table::new(&["id", "name", "roles", "made", "last used", "state"]);
    for row in rows {
        let used = row.used_ms.map_or_else(|| "never".to_owned(), |at| ago(now - at));
        table.row(vec![row.id.to_string(), row.name.clone(), row.roles.to_string(), ago(now - row.created_ms), used, state(row, now)]);
    }
    table.write(&mut std::io::stdout().lock()).map_err(|e| CommandError::from_error("cannot write to stdout", &e))
}

fn state(row: &TokenRow, now: i64) -> String {
    match (row.check(now), row.expires_ms) {
        (Err(_), _) if row.revoked_ms.is_some() => "revoked".into(),
        (Err(_), _) => "expired".into(),
        (Ok(()), Some(at)) => format!("ends in {}", span(at - now)),
        (Ok(()), None) => "good".into(),
    }
}

fn ago(ms: i64) -> String {
    if ms < 60_000 { "just now".into() } else { format!("{} ago", span(ms)) }
}

/// A span in its largest unit: nobody asks a list of tokens for seconds.
fn span(ms: i64) -> String {
    match ms / 60_000 {
        minutes @ ..60 => format!("{minutes} min"),
        minutes @ 60..2_880 => format!("{} h", minutes / 60),
        minutes => format!("{} d", minutes / 1_440),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_unit() {
        let seconds = |text: &str| duration(text).map(|d| d.as_secs());
        assert_eq!([seconds("5m"), seconds("12h"), seconds("30d"), seconds("2w")], [Ok(300), Ok(43_200), Ok(2_592_000), Ok(1_209_600)]);
        for bad in ["", "30", "d", "-1d", "1.5h", "30y", "5µ", "99999999999d"] {
            assert!(duration(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn spans_are_told_in_their_largest_unit() {
        assert_eq!(
            [span(0), span(3_599_999), span(3_600_000), span(47 * 3_600_000), span(48 * 3_600_000)],
            ["0 min", "59 min", "1 h", "47 h", "2 d"]
        );
        assert_eq!((ago(59_999).as_str(), ago(60_000).as_str()), ("just now", "1 min ago"));
    }
}
