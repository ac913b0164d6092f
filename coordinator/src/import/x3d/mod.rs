//! X3D and VRML97: three encodings become one document.
//!
//! ```text
//! bytes ─ encoding ─► text ─ xml | classic | json ─► syntax ─ resolve ─► document ─ evaluate ─► document at a time
//! ```
//! A reader of an encoding knows brackets and quotes and nothing of X3D; `table` knows the nodes and nothing of brackets; `resolve` joins
//! them, and everything that crosses names (DEF, USE, PROTO, IS, ROUTE, Inline) happens there, once. Values stay slices of the text until
//! the table says what they are, so a file costs its text and its numbers, and an unknown node costs nothing. The alternative, a reader
//! that types values as it goes, needs no second look at them, and writes PROTO three times.

mod document;
mod geometry;
mod literal;
mod node;
mod table;
mod value;

pub(super) use document::{Document, Inlined, NodeId, Place};
pub(super) use node::NodeRef;
