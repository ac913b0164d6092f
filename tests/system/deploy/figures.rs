//! Dashboard and alerts: every expression parses, and asks for figures that a coordinator has.

use super::{
    text,
    tools::{parse_promql, yaml},
};
use serde_json::Value;
use std::collections::BTreeSet;

/// Names of Kiln's metrics in a text.
fn metrics(text: &str) -> BTreeSet<&str> {
    let is_part = |c: char| c.is_ascii_lowercase() || c == '_';
    text.split(|c| !is_part(c)).filter(|word| word.strip_prefix("kiln_").is_some_and(|rest| !rest.is_empty())).collect()
}

/// Those that a coordinator has: the literals of its registry, with what Prometheus makes of a histogram.
fn served(source: &str) -> BTreeSet<String> {
    let (code, _) = source.split_once("#[cfg(test)]").unwrap();
    let mut names: BTreeSet<String> = code.split('"').filter(|word| metrics(word).contains(word)).map(str::to_owned).collect();
    for histogram in code.split("describe_histogram!(\"").skip(1).filter_map(|rest| rest.split('"').next()) {
        names.extend(["_bucket", "_sum", "_count"].map(|part| format!("{histogram}{part}")));
    }
    names
}

fn alerts() -> Vec<Value> {
    let file = &yaml(&["deploy/prometheus/alerts.yml"])[0];
    file["groups"].as_array().unwrap().iter().flat_map(|group| group["rules"].as_array().unwrap().clone()).collect()
}

fn panels() -> Vec<Value> {
    let dashboard: Value = serde_json::from_str(&text("deploy/grafana/kiln.json")).unwrap();
    dashboard["panels"].as_array().unwrap().clone()
}

fn expressions() -> Vec<String> {
    let panels = panels();
    let targets = panels.iter().flat_map(|panel| panel["targets"].as_array().into_iter().flatten());
    let asked = targets.map(|target| target["expr"].as_str().unwrap().replace("$job", "kiln").replace("$__rate_interval", "1m"));
    asked.chain(alerts().iter().map(|rule| rule["expr"].as_str().unwrap().to_owned())).collect()
}

#[test]
fn deploy_figures_exist() {
    let source = text("coordinator/src/http/metrics.rs");
    let (served, expressions) = (served(&source), expressions());
    assert!(served.len() > 15 && expressions.len() > 30);
    for expression in &expressions {
        for name in metrics(expression) {
            assert!(served.contains(name), "no coordinator has {name}, which `{expression}` asks for");
        }
    }
    for path in ["deploy/prometheus/alerts.test.yml", "deploy/kubernetes/scaledobject.yaml", "docs/operations.md"] {
        for name in metrics(&text(path)) {
            assert!(served.contains(name), "no coordinator has {name}, which {path} names");
        }
    }
    parse_promql(&expressions);
}

#[test]
fn deploy_alerts_are_explained_and_tried_out() {
    let (page, tests) = (text("docs/operations.md"), text("deploy/prometheus/alerts.test.yml"));
    let alerts = alerts();
    for rule in &alerts {
        let name = rule["alert"].as_str().unwrap();
        assert!(page.contains(&format!("`{name}`")), "docs/operations.md does not explain {name}");
        assert!(tests.contains(&format!("\"{name}\"")) || tests.contains(&format!("alertname: {name}")), "no test makes {name} fire");
        assert!(rule["annotations"]["summary"].is_string() && rule["annotations"]["description"].is_string(), "{name}");
        assert!(["critical", "warning", "info"].contains(&rule["labels"]["severity"].as_str().unwrap()), "{name}");
    }
    for name in page.split('`').filter(|word| word.starts_with("Kiln") && word.chars().all(char::is_alphabetic)) {
        assert!(alerts.iter().any(|rule| rule["alert"] == name), "docs/operations.md explains {name}, which does not exist");
    }
}

#[test]
fn deploy_dashboard_is_laid_out() {
    let panels = panels();
    let ids: BTreeSet<u64> = panels.iter().map(|panel| panel["id"].as_u64().unwrap()).collect();
    assert_eq!(ids.len(), panels.len(), "ids are unique");
    let mut taken = BTreeSet::new();
    for panel in &panels {
        let [x, y, w, h] = ["x", "y", "w", "h"].map(|key| panel["gridPos"][key].as_u64().unwrap());
        assert!(x + w <= 24, "{}", panel["title"]);
        for cell in (x..x + w).flat_map(|column| (y..y + h).map(move |line| (column, line))) {
            assert!(taken.insert(cell), "{} lies on another panel", panel["title"]);
        }
    }
}
