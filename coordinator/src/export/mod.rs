//! Export: a canonical scene in a format that other programs read.

pub mod gltf;
