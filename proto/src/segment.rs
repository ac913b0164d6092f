//! Segments: the self-contained result of one tile.
