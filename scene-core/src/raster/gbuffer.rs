//! The G-buffer: visibility by depth, then the exact hit of each pixel's ray with its triangle.

use glam::{DMat4, DVec3, DVec4, Vec2};
use rayon::prelude::*;

use super::MAX_SIDE;
use super::bins::BAND_ROWS;
use super::depth::Cull;
use super::draw::{Drawing, RasterScratch, draw};
use super::pixels::{DepthPixels, TrianglePixels};
use super::projection::Projection;
use crate::{Camera, GBuffer, Scene};

/// What `camera` sees of all objects of `scene`, casters or not.
///
/// Which triangle is seen is decided by depth maps' rules; position and depth then are those of the ray through
/// the pixel's centre in the plane of the triangle as given, not snapped: they equal ray casting. Where only the
/// snapped triangle covers the centre (within 2⁻⁹ pixel of its outline) or it is seen edge-on, the hit is kept
/// between the nearest and farthest corner. A triangle without area, which can only show in a crack of a pixel's
/// fraction, faces the camera. Nothing nearer than `near` or farther than `far` is seen.
///
/// # Panics
/// If a side is longer than [`MAX_SIDE`]; [`Camera::validate`] checks that.
pub fn render_gbuffer(scene: &Scene, camera: &Camera) -> GBuffer {
    render_gbuffer_with(scene, camera, &mut RasterScratch::new())
}

/// [`render_gbuffer`] with memory that is kept from frame to frame.
///
/// # Panics
/// As [`render_gbuffer`].
pub fn render_gbuffer_with(scene: &Scene, camera: &Camera, scratch: &mut RasterScratch) -> GBuffer {
    let (width, height) = (camera.width, camera.height);
    assert!(width <= MAX_SIDE && height <= MAX_SIDE, "a side of {width} × {height} is above {MAX_SIDE}");
    let mut gbuffer = GBuffer::new(width, height);
    let drawing = Drawing {
        scene,
        projection: Projection::new(&clip_from_world(camera), width, height, true),
        width,
        height,
        cull: Cull::None,
        clamp: false,
        window: [0..width as i32, 0..height as i32],
    };
    let band = (width as usize * BAND_ROWS).max(1);
    let bands = gbuffer.depth.par_chunks_mut(band).zip(gbuffer.triangle.par_chunks_mut(band)).map(
        |(depth, triangle)| {
            // What lies exactly on the far plane is still nearer than nothing.
            let depth = DepthPixels { depth, clear: f32::NEG_INFINITY, negate: false };
            TrianglePixels { depth, triangle }
        },
    );
    let all = scene.objects().iter().zip(0..).map(|(o, id)| (o.triangles.clone(), id));
    draw(&drawing, all, scratch, bands);
    resolve(scene, camera, &mut gbuffer);
    gbuffer
}

/// The camera's matrix from the axes its rays are made of, in f64: far from the origin the f32 one is off by
/// whole pixels.
pub(super) fn clip_from_world(camera: &Camera) -> DMat4 {
    let axes = camera.world_from_view_rotation().as_dmat3();
    let rotation = axes.transpose();
    let view_from_world = DMat4::from_cols(
        rotation.x_axis.extend(0.0),
        rotation.y_axis.extend(0.0),
        rotation.z_axis.extend(0.0),
        (-(rotation * camera.eye.as_dvec3())).extend(1.0),
    );
    let tan = camera.tan_half_fov().as_dvec2();
    let (near, far) = (f64::from(camera.near), f64::from(camera.far));
    let (a, b) = if far.is_finite() { (near / (far - near), near * far / (far - near)) } else { (0.0, near) };
    let clip_from_view = DMat4::from_cols(
        DVec4::new(1.0 / tan.x, 0.0, 0.0, 0.0),
        DVec4::new(0.0, 1.0 / tan.y, 0.0, 0.0),
        DVec4::new(0.0, 0.0, a, -1.0),
        DVec4::new(0.0, 0.0, b, 0.0),
    );
    clip_from_view * view_from_world
}

/// Replaces nearness by the hit of each pixel's ray.
fn resolve(scene: &Scene, camera: &Camera, gbuffer: &mut GBuffer) {
    let width = gbuffer.width as usize;
    if width == 0 {
        return;
    }
    let rays = camera.rays();
    let (eye, forward) = (camera.eye.as_dvec3(), camera.forward().as_dvec3());
    let (near, far) = (f64::from(camera.near), f64::from(camera.far));
    let rows = gbuffer.position.par_chunks_mut(width).zip(gbuffer.normal.par_chunks_mut(width));
    let rows = rows.zip(gbuffer.depth.par_chunks_mut(width)).zip(gbuffer.triangle.par_chunks(width));
    let rows = rows.zip(gbuffer.object.par_chunks_mut(width));
    rows.enumerate().for_each(|(y, ((((position, normal), depth), triangle), object))| {
        let mut plane = Plane::NONE;
        for x in 0..width {
            if triangle[x] == GBuffer::NOTHING {
                depth[x] = f32::INFINITY;
                continue;
            }
            if plane.triangle != triangle[x] {
                plane = Plane::new(scene, triangle[x], eye, forward);
            }
            let direction = rays.direction(Vec2::new(x as f32 + 0.5, y as f32 + 0.5)).as_dvec3();
            let t = plane.hit(direction).clamp(near, far);
            depth[x] = t as f32;
            position[x] = (eye + direction * t).as_vec3();
            normal[x] = plane.facing(direction).as_vec3();
            object[x] = plane.object;
        }
    });
}

/// The plane of a triangle, relative to the eye.
struct Plane {
    triangle: u32,
    object: u32,
    /// Unit, or zero for a triangle without area.
    normal: DVec3,
    /// Distance of the plane along its normal.
    distance: f64,
    /// Depth of the nearest and of the farthest corner.
    range: [f64; 2],
}

impl Plane {
    const NONE: Self = Self {
        triangle: GBuffer::NOTHING,
        object: GBuffer::NOTHING,
        normal: DVec3::ZERO,
        distance: 0.0,
        range: [0.0; 2],
    };

    fn new(scene: &Scene, triangle: u32, eye: DVec3, forward: DVec3) -> Self {
        let [a, b, c] = scene.corners(triangle as usize).map(|p| p.as_dvec3() - eye);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let depths = [a, b, c].map(|p| forward.dot(p));
        Self {
            triangle,
            object: scene.object_of(triangle as usize),
            normal,
            distance: normal.dot(a),
            range: [depths[0].min(depths[1]).min(depths[2]), depths[0].max(depths[1]).max(depths[2])],
        }
    }

    /// Depth at which a ray from the eye meets the plane.
    fn hit(&self, direction: DVec3) -> f64 {
        let t = self.distance / self.normal.dot(direction);
        // `max` and `min` let the limits win over NaN, that is a triangle without area.
        t.max(self.range[0]).min(self.range[1])
    }

    /// The normal, turned against the ray.
    fn facing(&self, direction: DVec3) -> DVec3 {
        if self.normal == DVec3::ZERO {
            return -direction.normalize_or_zero();
        }
        if self.normal.dot(direction) > 0.0 { -self.normal } else { self.normal }
    }
}
