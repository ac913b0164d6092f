//! From the document to the canonical scene.
//!
//! ```text
//! walk ─► shapes, lights, viewpoints with their places
//!   shapes ─► meshes in the world ─► boxes of what casts and receives
//!     lights ─► projections completed from the boxes ─► projectors
//!       materials (which may name projectors) ─► surfaces
//! ```
//! The order follows from who needs whom: an automatic projection needs meshes, a projected texture needs projections. Building shape by
//! shape in one pass would have to come back to each of them.

mod address;
mod build;
mod colours;
mod coordinates;
mod environment;
mod fit;
mod form;
mod inlined;
mod light;
mod material;
mod own;
mod pixels;
mod projection;
mod projectors;
mod reach;
mod shadow;
mod shape;
mod space;
mod texture;
mod view;
mod walk;

pub(super) use build::build;
pub(super) use own::of_colour;

#[cfg(test)]
mod tests;
