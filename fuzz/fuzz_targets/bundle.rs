#![no_main]
kiln_fuzz::target!("bundle");
