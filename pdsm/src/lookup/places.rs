//! Where a batch of receivers lies on a window, coordinate by coordinate: loops without branches over as many numbers as
//! there are receivers, which become vector instructions.

use glam::{Vec2, Vec3};

use super::{BATCH, Lanes, T_ERROR, read_before};
use crate::cpu::Window;
use crate::layout::Placement;

/// Points or directions of a batch; zero beyond its end.
pub(super) struct Points([Lanes<f32>; 3]);

impl Points {
    #[inline(always)]
    pub(super) fn new(points: &[Vec3]) -> Self {
        let mut own = Self([[0.0; BATCH]; 3]);
        for (k, point) in points.iter().enumerate().take(BATCH) {
            own.0[0][k] = point.x;
            own.0[1][k] = point.y;
            own.0[2][k] = point.z;
        }
        own
    }

    #[inline(always)]
    fn get(&self, k: usize) -> Vec3 {
        Vec3::new(self.0[0][k], self.0[1][k], self.0[2][k])
    }
}

/// Where the receivers of a batch lie on a window, and at which depth it is read there.
pub(super) struct Places {
    /// Whether it is this window that looks at the receiver.
    pub(super) belongs: Lanes<bool>,
    /// Whether it is read: its functions say something of the receiver.
    pub(super) is_read: Lanes<bool>,
    /// Whether all of the light is above the receiver's plane; of what has no plane, too.
    pub(super) is_above: Lanes<bool>,
    /// Whether none of it is.
    pub(super) is_below: Lanes<bool>,
    /// Position on the PDSM, in pixels.
    pub(super) pixel: [Lanes<f32>; 2],
    /// Depth there.
    pub(super) t: Lanes<f32>,
    /// How much it grows from pixel to pixel.
    pub(super) slope: [Lanes<f32>; 2],
    /// Receivers and normals, for those whose plane cuts the light.
    surfaces: [[Lanes<f32>; 3]; 2],
}

impl Places {
    #[inline(always)]
    fn new() -> Self {
        Self {
            belongs: [false; BATCH],
            is_read: [false; BATCH],
            is_above: [true; BATCH],
            is_below: [false; BATCH],
            pixel: [[0.0; BATCH]; 2],
            t: [0.0; BATCH],
            slope: [[0.0; BATCH]; 2],
            surfaces: [[[0.0; BATCH]; 3]; 2],
        }
    }

    /// Of surfaces, which are read before themselves: see [`super::Lookup::surfaces`]. Those that face away from all of the
    /// light are not read if `skip` lets them be left out.
    #[inline(always)]
    pub(super) fn of_surfaces(
        window: &Window,
        position: &Points,
        normal: &Points,
        tolerance: &Lanes<f32>,
        asked: &Lanes<bool>,
        skip: bool,
    ) -> Self {
        let mut own = Self { surfaces: [position.0, normal.0], ..Self::new() };
        let grid = window.grid;
        let node_error = window.functions.nodes().depth_error();
        window.layout.placement.of_known_kind(
            #[inline(always)]
            |placement: Placement| {
                for k in 0..BATCH {
                    let (receiver, normal) = (position.get(k), normal.get(k));
                    let (at, belongs) = placement.place(receiver);
                    let (slope, lift) = placement.plane_slope(receiver, normal, at.t);
                    let rounding =
                        tolerance[k] * lift + T_ERROR * (at.t.abs() + (1.0 - at.t).abs()) + node_error;
                    let before = at.t - read_before(slope) - rounding;
                    let [above, below] = placement.sides(receiver, normal);
                    own.belongs[k] = belongs & asked[k];
                    own.is_read[k] = belongs & asked[k] & before.is_finite() & !(below & skip);
                    own.is_above[k] = above & before.is_finite();
                    own.is_below[k] = below;
                    own.set(k, grid.from_texels(at.texel), before, slope * grid.ratio as f32);
                }
            },
        );
        own
    }

    /// Of points without a surface.
    #[inline(always)]
    pub(super) fn of_points(window: &Window, points: &Points, asked: &Lanes<bool>) -> Self {
        let mut own = Self::new();
        let grid = window.grid;
        window.layout.placement.of_known_kind(
            #[inline(always)]
            |placement: Placement| {
                for (k, &asked) in asked.iter().enumerate() {
                    let (at, belongs) = placement.place(points.get(k));
                    own.belongs[k] = belongs & asked;
                    own.is_read[k] = belongs & asked;
                    own.set(k, grid.from_texels(at.texel), at.t, Vec2::ZERO);
                }
            },
        );
        own
    }

    #[inline(always)]
    fn set(&mut self, k: usize, pixel: Vec2, t: f32, slope: Vec2) {
        self.pixel[0][k] = pixel.x;
        self.pixel[1][k] = pixel.y;
        self.t[k] = t;
        self.slope[0][k] = slope.x;
        self.slope[1][k] = slope.y;
    }

    /// Far outside of the window, and for what is no number, there is nothing; the limit keeps conversions to integers from
    /// saturating.
    #[inline(always)]
    pub(super) fn is_near(&self, k: usize) -> bool {
        (self.pixel[0][k].abs() < 1e6) & (self.pixel[1][k].abs() < 1e6)
    }

    /// The share of the light's samples above the plane of receiver `k`.
    pub(super) fn share_above(&self, k: usize, window: &Window) -> f32 {
        let [receiver, normal] = &self.surfaces;
        let get = |of: &[Lanes<f32>; 3]| Vec3::new(of[0][k], of[1][k], of[2][k]);
        window.layout.share_above(get(receiver), get(normal))
    }

    /// How many this window looks at face away from all of the light.
    #[inline(always)]
    pub(super) fn below(&self) -> u64 {
        let mut count = 0u32;
        for (&belongs, &is_below) in self.belongs.iter().zip(&self.is_below) {
            count += u32::from(belongs & is_below);
        }
        u64::from(count)
    }

    /// Leaves those waiting that this window does not look at; whether none are.
    #[inline(always)]
    pub(super) fn take_from(&self, waiting: &mut Lanes<bool>) -> bool {
        for (waiting, belongs) in waiting.iter_mut().zip(&self.belongs) {
            *waiting &= !belongs;
        }
        *waiting == [false; BATCH]
    }
}

#[cfg(test)]
impl Places {
    /// Requests at these pixels, depths and slopes, beyond the planes' and windows' concern.
    pub(super) fn at(requests: &[(Vec2, f32, Vec2)]) -> Self {
        let mut own = Self::new();
        for (k, &(pixel, t, slope)) in requests.iter().enumerate() {
            (own.belongs[k], own.is_read[k]) = (true, true);
            own.set(k, pixel, t, slope);
        }
        own
    }
}
