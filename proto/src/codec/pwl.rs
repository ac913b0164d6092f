//! Piecewise linear.
