//! What a process says of itself: lines on stderr, as text or as JSON, and spans to a collector that speaks OTLP.
//!
//! The libraries only know `tracing`; what becomes of its spans is decided here, so that a farm without a collector pays nothing for one.
//! Spans go out in batches from a thread of their own: a collector that is slow or away costs spans, never work.

use crate::error::CommandError;
use clap::{Args, ValueEnum};
use kiln_proto::chain;
use opentelemetry::trace::TracerProvider;
use opentelemetry_otlp::{WithExportConfig, WithHttpConfig};
use opentelemetry_sdk::{Resource, trace::SdkTracerProvider};
use reqwest::Url;
use std::{sync::OnceLock, time::Duration};
use tracing_subscriber::{
    EnvFilter, Layer,
    filter::{LevelFilter, Targets},
    layer::SubscriberExt,
    util::SubscriberInitExt,
};

/// How long the collector may take for a batch.
const PATIENCE: Duration = Duration::from_secs(5);

/// What is logged and traced
#[derive(Debug, Args)]
pub struct TelemetryArgs {
    /// What to log, in the syntax of `tracing` filters [default: warn, and for `serve` kiln::audit=info too]
    #[arg(long, global = true, value_name = "FILTER", env = "KILN_LOG")]
    log: Option<String>,
    /// How log lines look
    #[arg(long, global = true, value_name = "FORMAT", env = "KILN_LOG_FORMAT", value_enum, default_value_t = Format::Text)]
    log_format: Format,
    /// Send spans of requests, tasks and attempts to this OTLP/HTTP collector, such as http://127.0.0.1:4318
    #[arg(long, global = true, value_name = "URL", env = "OTEL_EXPORTER_OTLP_ENDPOINT")]
    otlp: Option<String>,
}

/// How log lines look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

/// What was said of logs and spans, as the environment of processes that this one starts.
static SAID: OnceLock<Vec<(&'static str, String)>> = OnceLock::new();

/// The environment in which another `kiln` logs and traces as this one does.
pub fn environment() -> &'static [(&'static str, String)] {
    SAID.get().map_or(&[], Vec::as_slice)
}

/// Logging and tracing while it lives; what has not been sent yet is sent when it goes.
pub struct Telemetry {
    spans: Option<SdkTracerProvider>,
}

impl TelemetryArgs {
    /// Begins to log and trace as `service`; outside any runtime, since the collector's client brings its own.
    ///
    /// # Errors
    /// A filter that cannot be read, a URL that no exporter takes.
    pub fn start(&self, service: &'static str, default_filter: &str) -> Result<Telemetry, CommandError> {
        let filter = self.log.as_deref().unwrap_or(default_filter);
        let filter = EnvFilter::try_new(filter).map_err(|e| CommandError::usage(format!("log filter `{filter}`: {e}")))?;
        let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
        let lines = match self.log_format {
            Format::Text => lines.boxed(),
            Format::Json => lines.json().flatten_event(true).boxed(),
        };
        // An empty variable is none, says the specification of OpenTelemetry.
        let collector = self.otlp.as_deref().filter(|url| !url.is_empty());
        let spans = collector.map(|url| provider(url, service)).transpose()?;
        let traced = spans.as_ref().map(|spans| {
            let ours = ["kiln", "kiln_coordinator", "kiln_worker"].map(|target| (target, LevelFilter::INFO));
            tracing_opentelemetry::layer().with_tracer(spans.tracer(service)).with_filter(Targets::new().with_targets(ours))
        });
        SAID.get_or_init(|| self.said());
        tracing_subscriber::registry().with(lines.with_filter(filter)).with(traced).init();
        Ok(Telemetry { spans })
    }

    fn said(&self) -> Vec<(&'static str, String)> {
        let format = match self.log_format {
            Format::Text => "text",
            Format::Json => "json",
        };
        let said = [
            ("KILN_LOG", self.log.clone()),
            ("KILN_LOG_FORMAT", Some(format.to_owned())),
            ("OTEL_EXPORTER_OTLP_ENDPOINT", self.otlp.clone()),
        ];
        said.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }
}

fn provider(url: &str, service: &'static str) -> Result<SdkTracerProvider, CommandError> {
    let wrong = |why: String| CommandError::usage(format!("--otlp {url}: {why}"));
    if !Url::parse(url).is_ok_and(|url| matches!(url.scheme(), "http" | "https")) {
        return Err(wrong("expected http://HOST:4318 or https://HOST, the address of an OTLP/HTTP collector".into()));
    }
    // The specification has exporters add the path of each signal to the one endpoint.
    let endpoint = format!("{}/v1/traces", url.trim_end_matches('/'));
    let client = reqwest::blocking::Client::builder().timeout(PATIENCE).build().map_err(|e| wrong(chain(&e)))?;
    let exporter = opentelemetry_otlp::SpanExporter::builder().with_http().with_http_client(client).with_endpoint(endpoint);
    let exporter = exporter.with_timeout(PATIENCE).build().map_err(|e| wrong(chain(&e)))?;
    // `OTEL_SERVICE_NAME` and `OTEL_RESOURCE_ATTRIBUTES` go before what we call ourselves.
    let named = std::env::var_os("OTEL_SERVICE_NAME").is_some();
    let resource = Resource::builder();
    let resource = if named { resource } else { resource.with_service_name(service) }.build();
    Ok(SdkTracerProvider::builder().with_batch_exporter(exporter).with_resource(resource).build())
}

impl Drop for Telemetry {
    fn drop(&mut self) {
        if let Some(Err(error)) = self.spans.take().map(|spans| spans.shutdown()) {
            eprintln!("warning: the last spans were not sent: {}", chain(&error));
        }
    }
}
