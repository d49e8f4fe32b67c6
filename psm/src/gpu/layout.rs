//! What shaders read and write, as they lay it out. A test holds every offset against the linked WGSL.

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Vec3, Vec4};
use scene_core::light::LightPoint;

use crate::caster_image::{DIRECTIONS, direction};
use crate::params::{Show, Variant};
use crate::seen::TileGrid;
use crate::view_frame::ViewFrame;
use crate::views::Images;
use crate::{Parametrisation, PsmParams, warp};

/// `Frame` of `frame.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct FrameUniform {
    /// Texels a side of each map.
    pub map_size: u32,
    /// 0 to 3, in the order of [`Variant::ALL`].
    pub variant: u32,
    /// 1 where d is written in place of V.
    pub shows_texels: u32,
    /// Images of the light.
    pub images: u32,
    /// Pixels a side of a tile.
    pub side: u32,
    /// Tiles a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
    /// Bits of the tolerance of the comparison, an f32.
    pub tolerance: u32,
    /// 1 where lookups follow surfaces.
    pub follows: u32,
}

impl FrameUniform {
    /// Of these settings, for `images` images of the light; `follows` says whether there are surfaces to follow.
    pub fn new(params: &PsmParams, images: usize, grid: TileGrid, tolerance: f32, follows: bool) -> Self {
        let variant = Variant::ALL.iter().position(|&variant| variant == params.variant);
        Self {
            map_size: params.map_size,
            variant: variant.unwrap_or(0) as u32,
            shows_texels: u32::from(params.show == Show::Texels),
            images: images as u32,
            side: grid.side,
            columns: grid.columns,
            rows: grid.rows,
            tolerance: tolerance.to_bits(),
            follows: u32::from(follows),
        }
    }
}

/// Beyond every place: `FAR` of `warp.wesl`.
const FAR: f32 = 3.0e38;

/// `LightImage` of `frame.wesl`: forms on positions relative to the eye.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ImageUniform {
    /// Places across, times w.
    pub x: Vec4,
    /// Places along, times w.
    pub y: Vec4,
    /// Distance along the axis of a light at a place; 1 else.
    pub w: Vec4,
    /// The light relative to the eye, 1 last; or the direction to it, 0 last.
    pub light: Vec4,
    /// Along parallel light, the casters' far end relative to the eye.
    pub along_low: f32,
    /// Their extent along it, margins included.
    pub along_range: f32,
    /// The paper's shift of the camera.
    pub papers_shift: f32,
    /// Sine of the angle between the image's axis and the view direction.
    pub sine: f32,
    /// Supports of the part of the image that casters fill, places of parallel light relative to the eye's.
    pub filled: [Vec4; DIRECTIONS / 4],
}

impl ImageUniform {
    /// Of each image.
    pub fn all(images: &Images, frame: &ViewFrame) -> Vec<Self> {
        (0..images.images.len()).map(|index| Self::new(images, index, frame)).collect()
    }

    fn new(images: &Images, index: usize, frame: &ViewFrame) -> Self {
        let (image, papers_shift) = (&images.images[index], images.papers_shift[index]);
        let form = |axis: DVec3, from: DVec3| axis.extend(axis.dot(from)).as_vec4();
        let (axes, zero) = (image.axes, DVec3::ZERO);
        let (from, w, light, [low, range]) = match image.light {
            LightPoint::At(place) => {
                // Of the eye, as seen from the light.
                let from = frame.eye - place.as_dvec3();
                (from, form(-axes.z_axis, from), (-from).extend(1.0), [0.0, 1.0])
            }
            LightPoint::Towards(towards) => {
                let towards = towards.as_dvec3();
                let [low, range] = warp::along(towards, images.casters);
                (zero, Vec4::W, towards.extend(0.0), [low - towards.dot(frame.eye), range])
            }
        };
        // Only parallel light's places know an origin.
        let origin = match image.light {
            LightPoint::At(_) => DVec2::ZERO,
            LightPoint::Towards(_) => image.warp.place(frame.eye),
        };
        let filled: [f32; DIRECTIONS] = std::array::from_fn(|i| {
            let support = images.filled[index].supports[i] - direction(i).dot(origin);
            // Shaders know no infinity.
            (support as f32).clamp(-FAR, FAR)
        });
        Self {
            x: form(axes.x_axis, from),
            y: form(axes.y_axis, from),
            w,
            light: light.as_vec4(),
            along_low: low as f32,
            along_range: range as f32,
            papers_shift: papers_shift as f32,
            sine: axes.z_axis.cross(frame.forward).length() as f32,
            filled: bytemuck::cast(filled),
        }
    }
}

/// `CasterBox` of `caster_boxes.wesl`: bounds of an object that casts, relative to the eye.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct BoxOnGpu {
    /// Lower corner; 0 last.
    pub low: Vec4,
    /// Upper corner; 0 last.
    pub high: Vec4,
}

impl BoxOnGpu {
    /// Of each object that casts.
    pub fn all(images: &Images, frame: &ViewFrame) -> Vec<Self> {
        let from_eye = |corner: Vec3| (corner.as_dvec3() - frame.eye).extend(0.0).as_vec4();
        images.boxes.iter().map(|b| Self { low: from_eye(b.min), high: from_eye(b.max) }).collect()
    }
}

/// `View` of `frame.wesl`: what a map covers, found on the GPU.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct ViewOnGpu {
    /// x, y and w of normalised device coordinates, as forms on positions relative to the eye.
    pub ndc: [Vec4; 3],
    /// 1 to 3, in the order of [`Variant::ALL`]; 4 for what `auto` fits; 0 for no map.
    pub parametrisation: u32,
    /// Of the virtual camera, for [`Parametrisation::Psm`].
    pub shift: f32,
    /// Mean of what the parametrisation was chosen by.
    pub measure: f32,
    /// Zero.
    pub padding: u32,
}

impl ViewOnGpu {
    /// How its texels are spread; `None` for no map.
    pub fn parametrisation(&self) -> Option<Parametrisation> {
        match self.parametrisation {
            1 => Some(Parametrisation::Psm { shift: f64::from(self.shift) }),
            2 => Some(Parametrisation::Lispsm),
            3 => Some(Parametrisation::Uniform),
            4 => Some(Parametrisation::Fitted),
            _ => None,
        }
    }
}

/// `Casters` of `casters.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct CasterUniform {
    /// Texels a side of each map.
    pub map_size: u32,
    /// Room for runs, an image of the light.
    pub runs: u32,
    /// Room for pieces, likewise.
    pub pieces: u32,
    /// 1 where what lies beside a map is left out.
    pub skips: u32,
}

/// `Run` of `casters.wesl`: triangles that follow one another.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct RunOnGpu {
    /// Lower corner of their bounds, world space.
    pub low: Vec3,
    /// The first.
    pub first: u32,
    /// Upper corner.
    pub high: Vec3,
    /// Behind the last.
    pub end: u32,
    /// The cloud that may be drawn in their place, or [`NO_CLOUD`].
    pub cloud: u32,
    /// Zeros.
    pub padding: [u32; 3],
}

/// Triangles that are drawn as such.
pub const NO_CLOUD: u32 = u32::MAX;

/// `Cloud` of `points.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CloudOnGpu {
    /// Lower corner of its object's bounds, world space.
    pub low: Vec3,
    /// Its first point.
    pub first: u32,
    /// Upper corner.
    pub high: Vec3,
    /// How many points it has.
    pub count: u32,
    /// Of its surface, one side.
    pub area: f32,
    /// Zeros.
    pub padding: [u32; 3],
}

/// `Draws` of `casters.wesl`: what an image's map is drawn of, as arguments of indirect draws.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub struct DrawsOnGpu {
    /// Vertices, 1, 0, 0.
    pub triangles: [u32; 4],
    /// Likewise.
    pub points: [u32; 4],
    /// Triangles without a mask that are drawn.
    pub triangle_count: u32,
    /// Points that are drawn.
    pub point_count: u32,
    /// Zeros.
    pub padding: [u32; 2],
}

/// Bytes of a `Tile` of `frame.wesl`.
pub const TILE_BYTES: u64 = 20;

/// Bytes of a `Choice` of `frame.wesl`.
pub const CHOICE_BYTES: u64 = 128;

/// Workgroups that share the tiles of an image whose pixels are asked: `FITTERS` of `seen.wesl`.
pub const FITTERS: u32 = 64;

/// Bytes of a tile's fit: three vectors. Before, of its sample.
pub const FIT_BYTES: u64 = 48;

/// Bytes from one projection to the next: what every device takes for the offset of a uniform.
pub const PROJECTION_STRIDE: u64 = 256;

#[cfg(test)]
mod tests {
    use scene_core::GBuffer;
    use scene_core::assert_layout;
    use scene_core::geometry::NO_TRIANGLE;
    use scene_core::gpu::RUN;
    use scene_core::gpu::testing::{assert_constants, struct_layout};
    use scene_core::raster::DEPTH_POSITION_ERROR;

    use super::*;
    use crate::gpu::shaders::{CASTERS, CHOICE, LOOKUP, SEEN, SPLATS, VIEWS};
    use crate::points::PIECE;
    use crate::{Lookup, caster_boxes, choice, fitted, follow, seen, virtual_camera};

    #[test]
    fn layouts_are_those_of_the_shaders() {
        assert_layout!(
            FrameUniform,
            LOOKUP,
            "Frame",
            [map_size, variant, shows_texels, images, side, columns, rows, tolerance, follows]
        );
        assert_layout!(
            ImageUniform,
            CHOICE,
            "LightImage",
            [x, y, w, light, along_low, along_range, papers_shift, sine, filled]
        );
        assert_layout!(BoxOnGpu, SEEN, "CasterBox", [low, high]);
        assert_layout!(ViewOnGpu, VIEWS, "View", [ndc, parametrisation, shift, measure]);
        assert_layout!(CasterUniform, CASTERS, "Casters", [map_size, runs, pieces, skips]);
        assert_layout!(RunOnGpu, CASTERS, "Run", [low, first, high, end, cloud]);
        assert_layout!(CloudOnGpu, CASTERS, "Cloud", [low, first, high, count, area]);
        assert_layout!(DrawsOnGpu, CASTERS, "Draws", [triangles, points, triangle_count, point_count]);
        assert_eq!(struct_layout(SEEN, "Tile").1 as u64, TILE_BYTES);
        assert_eq!(struct_layout(SEEN, "Choice").1 as u64, CHOICE_BYTES);
    }

    #[test]
    fn constants_are_those_of_the_shaders() {
        assert_constants(
            SEEN,
            &[
                ("GRAZING_COS", f64::from(seen::GRAZING_COS)),
                ("FITTERS", f64::from(FITTERS)),
                ("caster_boxes_LEAST_PASSED", caster_boxes::LEAST),
                ("caster_boxes_LEAN", caster_boxes::LEAN),
            ],
        );
        assert_constants(
            CHOICE,
            &[
                ("STEPS", virtual_camera::STEPS as f64),
                ("ROUNDS", virtual_camera::ROUNDS as f64),
                ("LEAST_GAIN", choice::least_gain(Lookup::Texel)),
                ("SLACK", f64::from(seen::SLACK)),
                ("LEAN", fitted::LEAN),
                ("caster_image_DIRECTIONS", DIRECTIONS as f64),
                ("fitted_CHOICES", fitted::CHOICES as f64),
                ("fitted_MOST_SAMPLES", fitted::MOST_SAMPLES as f64),
                ("fitted_FIRST_STEP", f64::from(fitted::FIRST_STEP)),
                ("fitted_ROUNDS", f64::from(fitted::ROUNDS)),
                ("fitted_SAME_SHAPE", f64::from(fitted::SAME)),
                ("fitted_LEAST_W", f64::from(fitted::LEAST_W)),
                ("warp_MARGIN", warp::MARGIN),
                ("warp_FAR", f64::from(FAR)),
            ],
        );
        assert_constants(
            CASTERS,
            &[
                ("RUN", f64::from(RUN)),
                ("PIECE", f64::from(PIECE)),
                ("NO_CLOUD", f64::from(NO_CLOUD)),
                ("FAR", f64::from(FAR)),
            ],
        );
        assert_constants(SPLATS, &[("PIECE", f64::from(PIECE))]);
        assert_constants(VIEWS, &[("warp_NEAR_FRACTION", warp::NEAR_FRACTION)]);
        assert_constants(
            LOOKUP,
            &[
                ("NOTHING", f64::from(GBuffer::NOTHING)),
                ("DEPTH_POSITION_ERROR", f64::from(DEPTH_POSITION_ERROR)),
                ("follow_STEPS", f64::from(follow::STEPS)),
                ("follow_NO_TRIANGLE", f64::from(NO_TRIANGLE)),
            ],
        );
    }
}
