//! `smoothies` and `penumbra-map`: the hard shadow is the umbra, and V rises outside of it.
//!
//! Both hang a soft border on the silhouettes that the light's centre sees. In the light's coordinates (a, b) over a
//! receiver ([`LightCone`](gnomon_shadow_map::light_cone::LightCone)) the centre lies at the distance D from the edge: 0 on the hard
//! shadow's border, 1 where the edge leaves a round light. Both ramps are linear, V = D.
//!
//! - Smoothies (Chan and Durand 2003) draw quadrilaterals into the map; the depth test keeps the one nearest to the light.
//!   α = D there is their α/(1 − b/r) of a smoothie as wide as the light is seen from the edge, so that V is 0 at contact.
//! - Penumbra maps (Wyman and Hansen 2003) draw cones at vertices and sheets at edges; the darkest is kept.

use glam::{Vec2, Vec3};

use crate::coverage::{Site, TileEdges};

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
            Kept::Nearest if along <= nearest => {}
            Kept::Nearest => (v, nearest) = (distance, along),
            Kept::Darkest => v = v.min(distance),
        }
    }
    v
}

/// Distance of the light's centre from an edge in (a, b), and how far towards the light the nearest point is.
fn from_center([a, b]: [Vec3; 2]) -> (f32, f32) {
    // An end cut off at the receiver is infinitely far away: a large number does.
    let flat = |end: Vec3| Vec2::new(end.x, end.y) / end.z.max(f32::MIN_POSITIVE.sqrt());
    let (from, to) = (flat(a), flat(b));
    let way = to - from;
    let share = (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    let share = if share.is_nan() { 0.0 } else { share };
    let point = from + way * share;
    // 1/t is affine over the projected edge.
    let inverse = (1.0 / a.z) + (1.0 / b.z - 1.0 / a.z) * share;
    (point.length(), 1.0 / inverse)
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
    }
}
