//! The visibility image: what every technique fills and ground truth is compared by.

/// Visibility of one light per camera pixel, row by row from the top left, in [0, 1]; NaN where the camera
/// sees nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct VisibilityImage {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// V of each pixel.
    pub values: Vec<f32>,
}

impl VisibilityImage {
    /// An image in which nothing is seen yet.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, values: vec![f32::NAN; width as usize * height as usize] }
    }

    /// V at column `x`, row `y`.
    ///
    /// # Panics
    /// Outside the image.
    pub fn at(&self, x: u32, y: u32) -> f32 {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) is outside the image");
        self.values[y as usize * self.width as usize + x as usize]
    }

    /// The bits of V of each pixel: equal only where images are the same to the last bit, NaN included.
    pub fn bits(&self) -> Vec<u32> {
        self.values.iter().map(|v| v.to_bits()).collect()
    }
}
