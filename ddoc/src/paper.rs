//! `paper`: splats as published, with the two artefacts that the paper reports.
//!
//! Each set texel of the discontinuity map is a splat: its centre, a direction from the texels around it, and the near and
//! far z of the gap. Its light intensities are those of a half-plane across the texel, perpendicular to the direction, as
//! the surface at the far z sees it. At shading the splat whose centre is nearest to the receiver's texel is used, if the
//! receiver lies behind its near z. So
//!
//! 1. where casters lie over one another at different depths, points get the wrong splat, or one where another caster
//!    hides all of the light;
//! 2. directions are those of eight texels around, and change from one splat to the next;
//! 3. penumbrae are right on the far surface alone.

use glam::{Vec2, Vec3};
use gnomon_shadow_map::light_cone::LightCone;
use gnomon_shadow_map::light_maps::Receiver;
use gnomon_shadow_map::receiver_plane::{is_near, rises_above};
use rayon::prelude::*;
use scene_core::Light;
use scene_core::geometry::Aabb;
use scene_core::light::LightHull;

use crate::discontinuity::Discontinuities;
use crate::image_edges::outline;
use crate::light_image::LightImage;
use crate::silhouettes::Edge;
use crate::splat::Cast;

/// The splats of a map, each as the edge it stands for: across its texel, the near side on the left, relative to `origin`.
pub fn texel_splats(map: &Discontinuities<'_>, origin: Vec3, bounds: Aabb) -> Vec<Edge> {
    let image = map.image();
    let size = image.size as i32;
    // Where nothing is stored, the farthest surface there may be.
    let bottom =
        bounds.corners().map(|corner| image.along(corner)).into_iter().fold(f32::NEG_INFINITY, f32::max);
    let rows = (0..size).into_par_iter().map(|row| {
        (0..size).filter_map(|column| texel_splat(map, [column, row], origin, bottom)).collect::<Vec<_>>()
    });
    rows.collect::<Vec<_>>().concat()
}

fn texel_splat(map: &Discontinuities<'_>, texel: [i32; 2], origin: Vec3, bottom: f32) -> Option<Edge> {
    if !map.bit(texel) {
        return None;
    }
    let near = map.surface(texel)?;
    let (mut towards, mut far) = (Vec2::ZERO, None);
    for y in -1..=1 {
        for x in -1..=1 {
            let beside = map.surface([texel[0] + x, texel[1] + y]);
            if beside.is_none_or(|beside| beside.along > near.along) && map.is_gap(&near, beside.as_ref()) {
                towards += Vec2::new(x as f32, y as f32);
                let farther = |far: &f32| beside.is_some_and(|beside| beside.along > *far);
                far = match (far, beside) {
                    (None, Some(beside)) => Some((beside.along, beside.point)),
                    (Some((along, _)), Some(beside)) if farther(&along) => Some((beside.along, beside.point)),
                    _ => far,
                };
            }
        }
    }
    let towards = towards.try_normalize()?;
    // The gap lies half a texel from the centre; the near side is left of the way along it, y down.
    let middle = Vec2::new(texel[0] as f32 + 0.5, texel[1] as f32 + 0.5) + towards * 0.5;
    let along = Vec2::new(towards.y, -towards.x) * 0.5;
    let ends = [middle - along, middle + along].map(|at| {
        let ndc = at * (2.0 / map.image().size as f32);
        map.image().view.unproject(Vec2::new(ndc.x - 1.0, 1.0 - ndc.y), near.depth) - origin
    });
    let far = match far {
        Some((_, point)) => point,
        None => map.image().thrown(near.point, map.center(), bottom)?,
    };
    let far = far - origin;
    Some(Edge { far, ..outline(ends) })
}

/// V of `receiver` under a light within its hull, whose centre sees it if `hard` is 1. `edges` are the splats that
/// may reach it, in any order, with their numbers.
pub fn visible<'e>(
    (light, hull): (&Light, Option<&LightHull>),
    image: &LightImage,
    receiver: &Receiver,
    origin: Vec3,
    edges: impl Iterator<Item = (u32, &'e Edge)>,
    points: &[Vec2],
    hard: f32,
) -> f32 {
    let Receiver { point, normal, tolerance, .. } = *receiver;
    let (Some(place), along) = (image.place(point), image.along(point)) else { return hard };
    let mut nearest: Option<(f32, u32, f32)> = None;
    for (number, edge) in edges {
        let ends = [edge.a, edge.b].map(|end| end + origin);
        let middle = ends[0].midpoint(ends[1]);
        let Some(at) = image.place(middle) else { continue };
        let distance = at.distance_squared(place);
        // Of equally near ones the first, whatever order they come in.
        let is_beaten = |&(least, first, _): &(f32, u32, f32)| (distance, number) >= (least, first);
        if image.along(middle) >= along || nearest.as_ref().is_some_and(is_beaten) {
            continue;
        }
        // The splat's texel may show the receiver's own surface.
        let diagonal = image.view.half_diagonal(image.view.depth_of(middle)) * (2.0 / image.size as f32);
        let is_own = !rises_above(middle, point, normal, tolerance)
            || is_near(middle, point, normal, light.center(), diagonal);
        if is_own {
            continue;
        }
        // The receiver moved along its line to the light's centre, down to the far z.
        let far = image.along(edge.far + origin);
        if !Cast::new(image, ends, hull).splat(far).is_some_and(|splat| splat.bounds.holds(place)) {
            continue;
        }
        let far_point = image.thrown(point, light.center(), far);
        let Some(cone) = far_point.and_then(|point| LightCone::new(light, point)) else { continue };
        let [a, b] = ends.map(|end| cone.locate(end));
        let line = a.cross(b);
        let mirrored = if cone.u.cross(cone.v).dot(cone.w) > 0.0 { -1.0 } else { 1.0 };
        // Seen from below the near side is right of the way from a to b; positive where the light is seen.
        let open = |at: Vec2| line.dot(at.extend(1.0)) * mirrored > 0.0;
        let seen = points.iter().filter(|&&at| open(cone.share(at))).count();
        // A splat ends where its half-plane hides all or nothing.
        if seen > 0 && seen < points.len() {
            nearest = Some((distance, number, seen as f32 / points.len() as f32));
        }
    }
    nearest.map_or(hard, |(_, _, v)| v)
}
