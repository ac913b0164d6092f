//! Whole-system tests: real processes over real sockets, killed for real. One binary, so that it links once.
#![allow(clippy::unwrap_used, clippy::expect_used)]
#![allow(clippy::print_stdout)] // The figures that a comparison came to are part of what the soak reports.

mod access;
mod bad_input;
mod bake;
mod browser;
mod chaos;
mod cluster;
mod contract;
mod convert;
mod deploy;
mod determinism;
mod environment;
mod fault_proxy;
mod faults;
mod full_disk;
mod golden;
mod harness;
mod made;
mod object_storage;
mod page;
mod page_cover;
mod page_job;
mod page_parity;
mod reference;
mod render;
mod restore;
mod sandbox;
mod servers;
mod service;
mod telemetry;
#[cfg(feature = "page")]
mod viewer;
mod worker_faults;
