//! Where a window has its points: the numbers of a [`Layout`](super::Layout) that this takes, by value, so that a loop over many
//! points branches on no kind of window.

use glam::{Vec2, Vec3};

use super::{Depth, Held, WindowPoint};

/// See the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// Origin of the axes, world space: the light's middle, or the scene's for parallel light.
    pub(crate) origin: Vec3,
    /// Unit axes: x and y of the window, and the way that light travels.
    pub(crate) axes: [Vec3; 3],
    pub(crate) depth: Depth,
    /// Lower corner of the window on its plane, in the axes' units.
    pub(crate) corner: Vec2,
    /// Texels per unit on the window's plane.
    pub(crate) texels_per_unit: Vec2,
    /// Only points whose tangents are within this of the axis belong here; infinite but for a cube's faces.
    pub(crate) max_tan: f32,
    /// The largest offset of a sample of the light along each axis.
    pub(crate) reach: Vec2,
    /// What belongs here, if that is but a part of the scene.
    pub(crate) part: Option<Held>,
}

impl Placement {
    /// Calls `work` where its kind is known when it is compiled: a branch within a loop over points would keep that from
    /// becoming vector instructions. `work` must be inlined.
    #[inline(always)]
    pub(crate) fn of_known_kind(self, mut work: impl FnMut(Self)) {
        match (self.depth, self.part) {
            (Depth::Central { focus }, None) => {
                work(Self { depth: Depth::Central { focus }, part: None, ..self });
            }
            (Depth::Central { focus }, Some(held)) => {
                work(Self { depth: Depth::Central { focus }, part: Some(held), ..self });
            }
            (Depth::Parallel { focus, per_unit }, None) => {
                work(Self { depth: Depth::Parallel { focus, per_unit }, part: None, ..self });
            }
            (Depth::Parallel { focus, per_unit }, Some(held)) => {
                work(Self { depth: Depth::Parallel { focus, per_unit }, part: Some(held), ..self });
            }
        }
    }

    /// A world-space direction in the axes.
    #[inline(always)]
    fn turned(self, direction: Vec3) -> Vec3 {
        let [x, y, z] = self.axes;
        Vec3::new(x.dot(direction), y.dot(direction), z.dot(direction))
    }

    /// World-space coordinates in the axes.
    #[inline(always)]
    pub(super) fn local(self, point: Vec3) -> Vec3 {
        self.turned(point - self.origin)
    }

    /// Where `point` lies, and whether this window is the one that looks at it.
    #[inline(always)]
    pub(crate) fn place(self, point: Vec3) -> (WindowPoint, bool) {
        let local = self.local(point);
        let (at, before) = self.place_local(local);
        let farthest = self.max_tan * local.z;
        let mut belongs = before;
        if matches!(self.depth, Depth::Central { .. }) {
            belongs &= (local.x.abs() <= farthest) & (local.y.abs() <= farthest);
        }
        if let Some(Held { bounds, texels: [low, high] }) = self.part {
            belongs &= (bounds.min.x <= point.x) & (bounds.min.y <= point.y) & (bounds.min.z <= point.z);
            belongs &= (bounds.max.x >= point.x) & (bounds.max.y >= point.y) & (bounds.max.z >= point.z);
            belongs &= (low.x <= at.texel.x) & (low.y <= at.texel.y);
            belongs &= (high.x >= at.texel.x) & (high.y >= at.texel.y);
        }
        (at, belongs)
    }

    /// Where a point lies, and whether it is before the light's plane.
    #[inline(always)]
    pub(super) fn place_local(self, local: Vec3) -> (WindowPoint, bool) {
        let (on_window, t, before) = match self.depth {
            Depth::Central { focus } => {
                let scale = focus / local.z;
                (local.truncate() * scale, 1.0 - scale, local.z > 0.0)
            }
            Depth::Parallel { focus, per_unit } => (local.truncate(), (local.z - focus) * per_unit, true),
        };
        (WindowPoint { texel: (on_window - self.corner) * self.texels_per_unit, t }, before)
    }

    /// How t changes along the plane through `point` with unit normal `normal`: per texel of the window, and per unit
    /// that the plane is moved along its normal.
    ///
    /// The plane N·X = h has 1/z = (N.xy·q/F + N.z)/h, so t = 1 − (N.xy·q + N.z·F)/h is linear in q; in parallel light
    /// z = (h − N.xy·q)/N.z. Infinite where the plane holds the light's middle.
    #[inline(always)]
    pub(crate) fn plane_slope(self, point: Vec3, normal: Vec3, t: f32) -> (Vec2, f32) {
        let n = self.turned(normal);
        match self.depth {
            Depth::Central { .. } => {
                let h = normal.dot(point - self.origin);
                (-n.truncate() / (h * self.texels_per_unit), ((1.0 - t) / h).abs())
            }
            Depth::Parallel { per_unit, .. } => {
                let scale = per_unit / n.z;
                (-n.truncate() * scale / self.texels_per_unit, scale.abs())
            }
        }
    }

    /// Whether all samples lie above the plane through `point` with unit normal `normal`, and whether none do: neither in
    /// doubt.
    #[inline(always)]
    pub(crate) fn sides(self, point: Vec3, normal: Vec3) -> [bool; 2] {
        let (n, _, middle) = self.height_of_light(point, normal);
        // Rounding is monotonic, so that no sample's own height above the middle, as it is computed, is more.
        let most = n.truncate().abs().dot(self.reach);
        [middle > most, middle < -most]
    }

    /// The normal in the axes, the sign of a sample's offset, and how high the light's middle is above the plane:
    /// N·(C + a − P) for a place, −N·(n + a) for a direction of travel.
    #[inline(always)]
    pub(super) fn height_of_light(self, point: Vec3, normal: Vec3) -> (Vec3, f32, f32) {
        let n = self.turned(normal);
        match self.depth {
            Depth::Central { .. } => (n, 1.0, normal.dot(self.origin - point)),
            Depth::Parallel { .. } => (n, -1.0, -n.z),
        }
    }
}
