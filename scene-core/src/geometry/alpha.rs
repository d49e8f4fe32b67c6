//! Cut-out masks: textures that decide which points of a triangle exist.

use std::sync::OnceLock;

use glam::Vec2;

use super::uncut::Holes;

/// What happens to a texture coordinate outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The texture repeats.
    #[default]
    Repeat,
    /// Every second copy is mirrored.
    Mirror,
    /// The edge texel goes on.
    Clamp,
}

impl Wrap {
    /// Maps an unbounded texel index into `0..size`.
    pub(super) fn texel(self, index: i64, size: i64) -> i64 {
        match self {
            Self::Repeat => index.rem_euclid(size),
            Self::Mirror => {
                let i = index.rem_euclid(2 * size);
                if i < size { i } else { 2 * size - 1 - i }
            }
            Self::Clamp => index.clamp(0, size - 1),
        }
    }
}

/// A one-bit cut-out: a point of a surface is solid where its texel's alpha reaches the cut-off.
///
/// The nearest texel decides, so that ray tracer, rasteriser and GPU cut along the very same lines whatever
/// their resolution. Texture coordinate (0, 0) is the corner of the first texel of the first row.
#[derive(Clone, Debug)]
pub struct AlphaMask {
    width: u32,
    height: u32,
    wrap: [Wrap; 2],
    solid: Vec<bool>,
    /// Counted when first asked for: one mask serves many objects.
    holes: OnceLock<Holes>,
}

impl PartialEq for AlphaMask {
    fn eq(&self, other: &Self) -> bool {
        let of = |mask: &Self| (mask.width, mask.height, mask.wrap);
        of(self) == of(other) && self.solid == other.solid
    }
}

impl Eq for AlphaMask {}

impl AlphaMask {
    /// A mask of `width` × `height` texels, row by row, from alpha values in [0, 255]; solid where
    /// `alpha >= cutoff × 255`. `None` if a side is zero or `alpha` has another length.
    pub fn from_alpha(width: u32, height: u32, alpha: &[u8], cutoff: f32, wrap: [Wrap; 2]) -> Option<Self> {
        let solid = alpha.iter().map(|&a| f32::from(a) >= cutoff * 255.0).collect();
        Self::from_solid(width, height, solid, wrap)
    }

    /// A mask of `width` × `height` texels, row by row. `None` if a side is zero or `solid` has another length.
    pub fn from_solid(width: u32, height: u32, solid: Vec<bool>, wrap: [Wrap; 2]) -> Option<Self> {
        let texels = (width as usize).checked_mul(height as usize)?;
        (texels > 0 && solid.len() == texels).then(|| Self {
            width,
            height,
            wrap,
            solid,
            holes: OnceLock::new(),
        })
    }

    /// Texels a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whether the surface exists at texture coordinate `uv`. A coordinate that is not finite is solid, so
    /// that a broken one never opens a hole.
    #[inline]
    pub fn is_solid(&self, uv: Vec2) -> bool {
        if !uv.is_finite() {
            return true;
        }
        let (w, h) = (i64::from(self.width), i64::from(self.height));
        // `as` saturates, so huge coordinates stay defined.
        let x = self.wrap[0].texel((uv.x * self.width as f32).floor() as i64, w);
        let y = self.wrap[1].texel((uv.y * self.height as f32).floor() as i64, h);
        self.solid[(y * w + x) as usize]
    }

    /// Whether the surface exists all over a triangle with these texture coordinates: then the mask cuts nothing of it. `false`
    /// where that is not certain, as within a texel of a hole.
    pub fn leaves_whole(&self, uvs: [Vec2; 3]) -> bool {
        self.holes.get_or_init(|| Holes::new(self)).leaves_whole(self, uvs)
    }

    /// Whether every texel is solid: then the mask cuts nothing and can be dropped.
    pub fn is_opaque(&self) -> bool {
        self.solid.iter().all(|&s| s)
    }

    /// Solid texels, row by row.
    pub fn texels(&self) -> &[bool] {
        &self.solid
    }

    /// How coordinates outside [0, 1] are treated, for u and v.
    pub fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker(wrap: Wrap) -> AlphaMask {
        AlphaMask::from_alpha(2, 2, &[255, 0, 0, 255], 0.5, [wrap; 2]).unwrap()
    }

    #[test]
    fn nearest_texel_decides() {
        let mask = checker(Wrap::Repeat);
        assert!(mask.is_solid(Vec2::new(0.25, 0.25)));
        assert!(!mask.is_solid(Vec2::new(0.75, 0.25)));
        assert!(mask.is_solid(Vec2::new(-0.25, -0.25)));
    }

    #[test]
    fn wrap_modes_differ_outside() {
        let uv = Vec2::new(1.25, 0.25);
        assert!(checker(Wrap::Repeat).is_solid(uv));
        assert!(!checker(Wrap::Mirror).is_solid(uv));
        assert!(!checker(Wrap::Clamp).is_solid(uv));
    }

    #[test]
    fn wrong_sizes_are_refused_and_broken_coordinates_are_solid() {
        assert!(AlphaMask::from_alpha(0, 2, &[], 0.5, [Wrap::Repeat; 2]).is_none());
        assert!(AlphaMask::from_alpha(2, 2, &[0; 3], 0.5, [Wrap::Repeat; 2]).is_none());
        let mask = AlphaMask::from_alpha(1, 1, &[0], 0.5, [Wrap::Repeat; 2]).unwrap();
        assert!(mask.is_solid(Vec2::NAN));
        assert!(!mask.is_solid(Vec2::splat(f32::MAX)));
    }
}
