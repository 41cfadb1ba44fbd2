//! Shared arithmetic.
