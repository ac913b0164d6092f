#![no_main]
kiln_fuzz::target!("segment");
