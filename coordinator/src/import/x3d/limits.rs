//! Bounds of X3D documents, so that no file makes the importer recurse, grow or run without end.

/// Nodes inside one another, in a file and on every path of a document. The readers recurse this deep, as may whoever walks a document.
pub(crate) const MAX_DEPTH: u16 = 200;
/// Nodes of a document, with prototypes expanded and files inlined.
pub(super) const MAX_NODES: usize = 1 << 20;
/// Statements, fields and nodes looked at while prototypes expand, beyond those that stand in the files: bounds what expands to nothing,
/// exponentially often.
pub(super) const MAX_STEPS: u64 = 1 << 20;
/// What an instance of a prototype counts: it has names of its own to set up.
pub(super) const INSTANCE_STEPS: u64 = 8;
/// Prototypes inside one another: a prototype made of a prototype takes more of the stack than a node in a node.
pub(super) const MAX_PROTO_DEPTH: usize = 32;
/// Files inlined into one another.
pub(super) const MAX_INLINE_DEPTH: usize = 16;
/// What a route counts: between instances there are as many as one has senders times the other has receivers.
pub(super) const ROUTE_STEPS: u64 = 4;
/// Calls of the resolver inside one another: a path of nodes, with the instances and files on it.
pub(super) const MAX_RECURSION: usize = MAX_DEPTH as usize + MAX_PROTO_DEPTH + MAX_INLINE_DEPTH;
/// Brackets inside one another in JSON, which takes three for a node.
pub(super) const MAX_JSON_DEPTH: usize = 4 * MAX_DEPTH as usize;
/// A compressed file may not expand to more than this many times its size (and 1 MiB more); texts of numbers come to 10.
pub(super) const MAX_INFLATION: u64 = 100;
