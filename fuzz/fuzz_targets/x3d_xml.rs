#![no_main]
kiln_fuzz::target!("x3d_xml");
