//! Averages over neighbours: where a penumbra is many pixels wide, the noise of the kernel's points goes and V stays.
//!
//! Each pixel moves its points at random, so neighbours on one surface ask other points of almost the same light. The
//! average is a tent of 3 × 3 pixels, (1, 2, 1)/4 a side. On a plane it is symmetric and leaves linear penumbrae as they
//! are. At each end of one, w pixels wide, V bends by 1/w, and the tent moves it by ¼·1/w (its mean distance from the
//! middle on one side): over the penumbra 1/(8w³) in the mean square. What it takes away is noise: an edge crosses about √n of the n
//! cells that the points stand for, each of which is wrong by a square of 1/(6n²) in the mean, n^(−3/2)/6 in all, and the tent's
//! weights leave 0.14 of that. It takes more than it adds from w = 0.95·√n on: w ≥ √n pixels, by the nearest blocker found. A
//! neighbour beside the plane by δ sees the light as if moved by δ: V differs by δ over the footprint's width in the
//! world, at most 1/n. Other pixels are left alone.

use glam::Vec3;
use rayon::prelude::*;
use scene_core::{GBuffer, VisibilityImage};

use crate::footprint::spread;
use crate::physical::{Physical, Site};
use crate::search::Blockers;

/// How a pixel takes part in the average.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// It does not.
    Apart,
    /// It counts for its neighbours: wholly lit or wholly dark.
    Certain,
    /// It is averaged with what lies this near to its plane, world units.
    Wide(f32),
}

/// Whether the penumbra of a pixel is wide enough, by the nearest blocker found.
pub fn role(physical: &Physical<'_>, site: &Site, blockers: &Blockers) -> Role {
    let count = physical.kernel.points.len() as f32;
    let bounds = site.footprint.bounds(physical.kernel.reach, blockers.least);
    let is_wide = bounds.is_some_and(|(min, max)| (max - min).min_element() >= count.sqrt());
    if !is_wide {
        return Role::Apart;
    }
    let axis = site.cone.u.length().min(site.cone.v.length());
    Role::Wide(2.0 * axis * spread(blockers.least, physical.is_parallel()) / count)
}

/// `shade.smooth`: the averages, in place of V of wide pixels.
pub fn smooth(gbuffer: &GBuffer, roles: &[Role], visibility: &mut VisibilityImage) {
    let (width, height) = (gbuffer.width as usize, gbuffer.height as usize);
    let source = visibility.values.clone();
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            let own = row * width + column;
            let Role::Wide(slack) = roles[own] else { continue };
            let (point, normal): (Vec3, Vec3) = (gbuffer.position[own], gbuffer.normal[own]);
            let (mut sum, mut all) = (0.0, 0.0);
            for y in row.saturating_sub(1)..=(row + 1).min(height - 1) {
                for x in column.saturating_sub(1)..=(column + 1).min(width - 1) {
                    let other = y * width + x;
                    let rise = normal.dot(gbuffer.position[other] - point).abs();
                    if roles[other] != Role::Apart && rise <= slack {
                        let weight = ((2 - x.abs_diff(column)) * (2 - y.abs_diff(row))) as f32;
                        sum += weight * source[other];
                        all += weight;
                    }
                }
            }
            *value = sum / all;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_penumbrae_stay_and_other_surfaces_are_not_asked() {
        let (width, height) = (5, 4);
        let mut gbuffer = GBuffer::new(width, height);
        let mut visibility = VisibilityImage::new(width, height);
        for pixel in 0..20 {
            let (x, y) = (pixel % 5, pixel / 5);
            // The last column lies below the rest.
            gbuffer.position[pixel] = Vec3::new(x as f32, if x == 4 { -1.0 } else { 0.0 }, y as f32);
            gbuffer.normal[pixel] = Vec3::Y;
            visibility.values[pixel] = if x == 4 { 9.0 } else { 0.1 * x as f32 };
        }
        let before = visibility.values.clone();
        let mut roles = [Role::Wide(0.5); 20];
        roles[11] = Role::Apart;
        smooth(&gbuffer, &roles, &mut visibility);
        for pixel in [6, 11] {
            assert!((visibility.values[pixel] - before[pixel]).abs() < 0.04, "{pixel}");
        }
        assert_eq!(visibility.values[11], before[11]);
        assert!(visibility.values[8] < 0.3 && visibility.values[4] == 9.0);
        // Between complete neighbours nothing moves.
        assert!((visibility.values[2] - 0.2).abs() < 1e-6);
    }
}
