//! X3D and VRML97.

pub mod geometry;
