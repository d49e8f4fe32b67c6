//! Pictures of what lies behind V: the setting `show`.

use scene_core::VisibilityImage;

use crate::distance_map::DistanceMap;
use crate::params::Show;

/// D over the greatest where a pixel is shadowed, 1 elsewhere.
pub(crate) fn distance(map: &DistanceMap, visibility: &mut VisibilityImage) {
    let greatest = map.distance.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    for ((value, &shadow), &distance) in visibility.values.iter_mut().zip(&map.shadow).zip(&map.distance) {
        if shadow == 1.0 {
            *value = distance / greatest;
        }
    }
}

impl Show {
    /// The mark of a penumbra: 0 at V = ½, up to 1 in the light and to ½ in the umbra.
    #[inline]
    pub fn penumbra_mark(v: f32) -> f32 {
        if v < 0.5 { 0.5 - v } else { 2.0 * v - 1.0 }
    }
}

/// Marks in place of V.
pub(crate) fn penumbra(visibility: &mut VisibilityImage) {
    visibility.values.iter_mut().for_each(|value| *value = Show::penumbra_mark(*value));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_darkest_amid_the_penumbra_and_continuous() {
        assert_eq!([0.0, 0.25, 0.5, 0.75, 1.0].map(Show::penumbra_mark), [0.5, 0.25, 0.0, 0.5, 1.0]);
        assert!(Show::penumbra_mark(f32::NAN).is_nan());
    }

    #[test]
    fn distances_are_shares_of_the_greatest() {
        let mut map = DistanceMap::new(4, 1);
        map.shadow.copy_from_slice(&[1.0, 1.0, 0.0, f32::NAN]);
        map.distance.copy_from_slice(&[0.2, 0.4, 0.0, 0.0]);
        let mut image = VisibilityImage::new(4, 1);
        image.values.copy_from_slice(&[0.0, 0.0, 1.0, 0.0]);
        distance(&map, &mut image);
        assert_eq!(image.values, [0.5, 1.0, 1.0, 0.0]);
    }
}
