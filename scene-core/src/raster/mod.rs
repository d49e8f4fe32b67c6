//! The CPU rasteriser: depth from any projection, and the G-buffer.
