//! The taps of a filter around one receiver: texels by column and row, beyond a cube face's border in the face beside
//! it, and the questions of [`receiver_plane`](crate::receiver_plane) for what they store.
//!
//! 1. *Does the stored point rise above the receiver's plane?* One comparison, [`TexelPlane`]: this is the receiver
//!    plane's depth at the tap, so filters of any radius lie flat on any slope.
//! 2. *Does the receiver lie behind the stored triangle's plane?* Keeps a lit wall from darkening the floor before it.
//! 3. *Is the stored point near*, so near that it may be the receiver's own surface, a texel or the filter's radius
//!    to the side? A surface rises along the light's ray by tan θ times its lateral distance r; as for a hard lookup
//!    its neighbours are given twice that, and twice 45° where it faces the light: 2·r·(1 + tan θ). Then the
//!    filter does not know better than the receiver's own lookup, which answers.

use std::cell::Cell;

use glam::{Vec2, Vec3};

use crate::filter_maps::FilterMaps;
use crate::light_maps::{Receiver, ShadowMapView};
use crate::receiver_plane::meets;
use crate::texel_plane::TexelPlane;

/// Looks up texels around one receiver.
#[derive(Debug)]
pub struct Taps<'m> {
    /// What is read.
    pub maps: &'m FilterMaps<'m>,
    /// The receiver.
    pub receiver: Receiver,
    /// The view that holds the receiver, an index into the maps.
    pub view: usize,
    /// The receiver in the view's texels: column and row, a texel's centre at one half.
    pub texel: Vec2,
    /// The receiver's plane in the view.
    pub plane: TexelPlane,
    /// Unit vector to the light's centre.
    to_light: Vec3,
    /// 1 + tan θ of the receiver's slope against the light.
    slope: f32,
    /// The receiver's own lookup, made when it is first asked for.
    own: Cell<Option<bool>>,
}

/// Column and row of the texel that a receiver at `texel` is in, of a map of `size` texels a side; beside the map, too. NDC 1
/// belongs to the last one.
#[inline]
pub(crate) fn own_texel(texel: Vec2, size: u32) -> [i32; 2] {
    let last = |at: i32| if at == size as i32 { at - 1 } else { at };
    texel.to_array().map(|at| last(at.floor() as i32))
}

/// A stored surface that rises above the receiver's plane.
#[derive(Clone, Copy, Debug)]
pub struct Stored {
    /// The view it is in.
    pub view: usize,
    /// Its texel in the view's map.
    pub index: usize,
    /// Reversed depth.
    pub depth: f32,
}

impl<'m> Taps<'m> {
    /// Taps around `receiver`; `None` if no map holds it, so that nothing shadows it.
    #[inline]
    pub fn new(maps: &'m FilterMaps<'m>, receiver: &Receiver) -> Option<Self> {
        let views = &maps.maps.maps;
        // A lone view ends at its casters; what lies beside it may still be in their penumbra.
        let (view, ndc) = match views.as_slice() {
            [lone] => (0, lone.view.project_beyond(receiver.point)?),
            faces => (0..)
                .zip(faces)
                .find_map(|(index, map)| map.view.project(receiver.point).map(|ndc| (index, ndc)))?,
        };
        let size = views[view].map.width;
        let (direction, _) = maps.maps.light.center().ray_from(receiver.point);
        let to_light = direction.normalize_or_zero();
        let cos = receiver.normal.dot(to_light).max(f32::MIN_POSITIVE);
        Some(Self {
            maps,
            receiver: *receiver,
            view,
            texel: views[view].texel_at(ndc),
            plane: TexelPlane::new(&views[view].view, size, receiver),
            to_light,
            slope: 1.0 + (1.0 - cos * cos).max(0.0).sqrt() / cos,
            own: Cell::new(None),
        })
    }

    /// The map that holds the receiver.
    #[inline]
    pub fn map(&self) -> &'m ShadowMapView {
        &self.maps.maps.maps[self.view]
    }

    /// The nearest depth of the texels between two corners, inclusive; `None` if they leave the map.
    #[inline]
    pub fn nearest(&self, first: [i32; 2], last: [i32; 2]) -> Option<f32> {
        let size = self.map().map.width as i32;
        let inside = first[0] >= 0 && first[1] >= 0 && last[0] < size && last[1] < size;
        inside.then(|| {
            let corner = |at: [i32; 2]| at.map(|at| at as usize);
            self.maps.pyramids[self.view].nearest(&self.map().map, corner(first), corner(last))
        })
    }

    /// Whether it is certain that no texel between two corners, inclusive, rises above the receiver's plane. Texels
    /// beyond the border of a lone view hold nothing; beyond that of a cube's face nothing is certain.
    #[inline]
    pub fn is_clear(&self, first: [i32; 2], last: [i32; 2]) -> bool {
        let (first, last) = match self.inside(first, last) {
            Some(inside) => inside,
            None if self.is_lone() => return true,
            None => return false,
        };
        self.nearest(first, last).is_some_and(|nearest| {
            let corner = |at: [i32; 2]| at.map(|at| at as f32);
            self.plane.hides_none(corner(first), corner(last), nearest)
        })
    }

    /// Whether there is one view, so that nothing is stored beyond its border.
    #[inline]
    pub fn is_lone(&self) -> bool {
        self.maps.maps.maps.len() == 1
    }

    /// The part of a rectangle of texels where something may be stored: of a lone view what is inside its map; of a cube's
    /// face all of it, or `None` if it leaves the face. `None` too if no texel is left.
    #[inline]
    pub fn inside(&self, first: [i32; 2], last: [i32; 2]) -> Option<([i32; 2], [i32; 2])> {
        let end = self.map().map.width as i32 - 1;
        let (low, high) = (first.map(|at| at.max(0)), last.map(|at| at.min(end)));
        let is_left = low[0] <= high[0] && low[1] <= high[1];
        (is_left && (self.is_lone() || (low, high) == (first, last))).then_some((low, high))
    }

    /// Question 1: what is stored in the texel of the receiver's view at `column` and `row`, if it rises above the
    /// receiver's plane.
    #[inline]
    pub fn risen(&self, column: i32, row: i32) -> Option<Stored> {
        let map = self.map();
        let size = map.map.width as i32;
        if (0..size).contains(&column) && (0..size).contains(&row) {
            if !map.holds(column as usize, row as usize) {
                return None;
            }
            let index = row as usize * size as usize + column as usize;
            let depth = map.map.depth[index];
            let rises = depth > 0.0 && self.plane.rise(column as f32, row as f32, depth) > 0.0;
            rises.then_some(Stored { view: self.view, index, depth })
        } else {
            self.risen_beside(column, row)
        }
    }

    /// [`risen`](Self::risen) beyond the border: the texel of another view that the same line from the light meets.
    #[cold]
    fn risen_beside(&self, column: i32, row: i32) -> Option<Stored> {
        let views = &self.maps.maps.maps;
        if views.len() < 2 {
            return None;
        }
        let map = self.map();
        let texel = 2.0 / map.map.width as f32;
        let ndc = Vec2::new((column as f32 + 0.5) * texel - 1.0, 1.0 - (row as f32 + 0.5) * texel);
        let depth = map.view.depth_of(self.receiver.point);
        self.risen_at(map.view.unproject(ndc, depth))
    }

    /// Question 1 for the texel that a point of space falls into, whichever view holds it.
    pub fn risen_at(&self, point: Vec3) -> Option<Stored> {
        let views = &self.maps.maps.maps;
        let (view, ndc) =
            (0..).zip(views).find_map(|(index, map)| map.view.project(point).map(|ndc| (index, ndc)))?;
        let map = &views[view];
        let size = map.map.width;
        let at = Vec2::new(ndc.x * 0.5 + 0.5, 0.5 - ndc.y * 0.5) * size as f32;
        let (column, row) = ((at.x as u32).min(size - 1), (at.y as u32).min(size - 1));
        if !map.holds(column as usize, row as usize) {
            return None;
        }
        let index = row as usize * size as usize + column as usize;
        let depth = map.map.depth[index];
        let plane =
            if view == self.view { self.plane } else { TexelPlane::new(&map.view, size, &self.receiver) };
        let rises = depth > 0.0 && plane.rise(column as f32, row as f32, depth) > 0.0;
        rises.then_some(Stored { view, index, depth })
    }

    /// The stored point, at its texel's centre, in world space.
    #[inline]
    pub fn point(&self, stored: &Stored) -> Vec3 {
        let map = &self.maps.maps.maps[stored.view];
        let size = map.map.width as usize;
        let texel = 2.0 / size as f32;
        let (column, row) = (stored.index % size, stored.index / size);
        let ndc = Vec2::new((column as f32 + 0.5) * texel - 1.0, 1.0 - (row as f32 + 0.5) * texel);
        map.view.unproject(ndc, stored.depth)
    }

    /// The triangle of a stored surface.
    #[inline]
    pub fn triangle(&self, stored: &Stored) -> usize {
        self.maps.maps.maps[stored.view].triangles[stored.index] as usize
    }

    /// Question 2: whether the receiver lies behind the stored triangle's plane.
    #[inline]
    pub fn is_behind(&self, stored: &Stored) -> bool {
        let Receiver { point, tolerance, .. } = self.receiver;
        self.maps.is_behind_texel(stored.view, stored.index, point, tolerance)
    }

    /// Question 3: whether the stored point may be of the receiver's own surface.
    #[inline]
    pub fn is_near(&self, stored: &Stored) -> bool {
        let map = &self.maps.maps.maps[stored.view];
        let texel = map.view.half_diagonal(stored.depth) * (2.0 / map.map.width as f32);
        let to_stored = self.point(stored) - self.receiver.point;
        let along = to_stored.dot(self.to_light);
        let lateral = (to_stored.length_squared() - along * along).max(0.0).sqrt();
        along <= (2.0 * lateral).max(texel) * self.slope
    }

    /// All questions: whether the stored surface shadows the receiver in a filter.
    #[inline]
    pub fn blocks(&self, stored: &Stored) -> bool {
        self.is_behind(stored) && (!self.is_near(stored) || self.is_blocked())
    }

    /// The surface in the receiver's own texel, if it shadows the receiver: the hard lookup.
    pub fn own_blocker(&self) -> Option<Stored> {
        let [column, row] = own_texel(self.texel, self.map().map.width);
        self.risen(column, row).filter(|stored| {
            let corners = || self.maps.maps.scene.corners(self.triangle(stored));
            let light = self.maps.maps.light.center();
            self.is_behind(stored) && (!self.is_near(stored) || meets(corners(), self.receiver.point, light))
        })
    }

    /// Whether the receiver's own texel shadows it.
    #[inline]
    pub fn is_blocked(&self) -> bool {
        self.own.get().unwrap_or_else(|| {
            let blocked = self.own_blocker().is_some();
            self.own.set(Some(blocked));
            blocked
        })
    }
}
