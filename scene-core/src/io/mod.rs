//! Loading scenes and writing images.
