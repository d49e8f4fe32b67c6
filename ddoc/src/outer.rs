//! `smoothies` and `penumbra-map`: the hard shadow is the umbra, and V rises outside of it.
//!
//! Both hang a soft border on the silhouettes that the light's centre sees. In the light's coordinates (a, b) over a
//! receiver ([`LightCone`](gnomon_shadow_map::light_cone::LightCone)) the centre lies at the distance D from the edge: 0 on the hard
//! shadow's border, 1 where the edge leaves a round light. Both ramps are linear, V = D.
//!
//! - Smoothies (Chan and Durand 2003) draw quadrilaterals into the map; the depth test keeps the one nearest to the light.
//!   α = D there is their α/(1 − b/r) of a smoothie as wide as the light is seen from the edge, so that V is 0 at contact.
//! - Penumbra maps (Wyman and Hansen 2003) draw cones at vertices and sheets at edges; the darkest is kept.

use glam::Vec3;

use crate::coverage::Site;
use crate::tile_edges::TileEdges;

/// Which of several splats over a receiver is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// The one nearest to the light.
    Nearest,
    /// The darkest.
    Darkest,
}

/// V of a receiver that the light's centre sees if `hard` is 1.
pub fn visible(kept: Kept, site: &Site, edges: &TileEdges, hard: f32) -> f32 {
    if hard == 0.0 {
        return 0.0;
    }
    let (mut v, mut nearest) = (1.0f32, 0.0);
    for index in 0..edges.len() {
        let Some(ends) = site.cut(edges.ends(index)) else { continue };
        let (distance, along) = from_center(ends);
        match kept {
            _ if distance >= 1.0 => {}
            Kept::Nearest if along < nearest => {}
            // Of equally near ones the darker, so that the order of edges does not matter.
            Kept::Nearest if along == nearest => v = v.min(distance),
            Kept::Nearest => (v, nearest) = (distance, along),
            Kept::Darkest => v = v.min(distance),
        }
    }
    v
}

/// Distance of the light's centre from an edge in (a, b), and how far towards the light the nearest point is.
///
/// Nothing is divided by t before it must: an end cut off at the receiver's plane may be a million lights away, where the
/// foot of the perpendicular would have no digits left.
fn from_center([a, b]: [Vec3; 2]) -> (f32, f32) {
    let line = a.cross(b);
    let across = line.truncate();
    // Places along the edge from the foot, times t.
    let (from, to) = (across.perp_dot(a.truncate()), across.perp_dot(b.truncate()));
    if from * to < 0.0 {
        return (line.z.abs() / across.length(), a.lerp(b, from / (from - to)).z);
    }
    // A t that was cut off at 0 may have been rounded below it.
    let of = |end: Vec3| (end.truncate().length() / end.z.max(0.0), end.z);
    let (a, b) = (of(a), of(b));
    if a.0 <= b.0 { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_is_found_in_perspective() {
        // From (1, −1) at t = ½ to (1, 1) at t = ¼: nearest is (1, 0), halfway on the light, at t = ⅓.
        let (distance, along) = from_center([Vec3::new(0.5, -0.5, 0.5), Vec3::new(0.25, 0.25, 0.25)]);
        assert!((distance - 1.0).abs() < 1e-6 && (along - 1.0 / 3.0).abs() < 1e-6);
        let (distance, _) = from_center([Vec3::new(0.5, 0.5, 0.5), Vec3::new(1.0, 0.5, 0.5)]);
        assert!((distance - 2f32.sqrt()).abs() < 1e-6);
        let (distance, _) = from_center([Vec3::new(0.5, -0.5, -1e-10), Vec3::new(0.6, -0.6, 1e-3)]);
        assert!(distance > 100.0);
    }
}
