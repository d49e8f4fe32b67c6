//! Shadow maps.
