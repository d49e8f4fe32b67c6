//! How far a compressed function may be from the true one: as far everywhere, or as far as a display shows it (the paper's future
//! work, section 6).

/// How far a compressed function may be from the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorBound {
    /// The largest error, at least 0.
    pub largest: f32,
    /// Whether the error counts as a display shows it: see [`at`](Self::at).
    pub of_display: bool,
}

/// Share of light that reaches a surface in full shadow, as [`ErrorBound::at`] takes it: a tenth, as skylight is beside the
/// sun's.
const AMBIENT: f64 = 0.1;

impl ErrorBound {
    /// The bound where V is `visibility`: the same everywhere, or so that a picture's values are off by the same everywhere.
    /// A picture holds the power 1/2.2 of light, whose slope is greatest in the dark: with a tenth of ambient light
    /// umbrae get 0.29 of the bound, and light all of it.
    #[inline]
    pub fn at(self, visibility: f64) -> f64 {
        let largest = f64::from(self.largest);
        if !self.of_display {
            return largest;
        }
        largest * (AMBIENT + (1.0 - AMBIENT) * visibility).powf(1.0 - 1.0 / 2.2)
    }
}

impl From<f32> for ErrorBound {
    fn from(largest: f32) -> Self {
        Self { largest, of_display: false }
    }
}
