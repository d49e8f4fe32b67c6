//! Four scenes under light from eight directions: how many pixels each variant gets wrong.

use glam::Vec3;
use gnomon_psm::{PreparedPsm, Psm, PsmParams, Variant};
use scene_core::bvh::Bvh;
use scene_core::reference::{self, ReferenceSettings, no_progress};
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster};

/// Names, and ways in which light travels for a camera: with the view and against it, from above, in the camera's
/// plane, and at 10° over the ground.
#[allow(dead_code, reason = "some of those who include this module bring lights of their own")]
pub(crate) fn directions(camera: &Camera) -> [(&'static str, Vec3); 8] {
    let side = camera.forward().cross(Vec3::Y).normalize();
    let ahead = Vec3::Y.cross(side);
    let up = side.cross(camera.forward());
    let at = |horizontal: Vec3, degrees: f32| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        horizontal * cos - Vec3::Y * sin
    };
    [
        ("front", at(-ahead, 45.0)),
        ("behind", at(ahead, 45.0)),
        ("above", Vec3::NEG_Y),
        ("camera's plane", (side - up).normalize()),
        ("across", at(-side, 35.0)),
        ("grazing across", at(side, 10.0)),
        ("grazing front", at(-ahead, 10.0)),
        ("slanting behind", at((ahead - side).normalize(), 30.0)),
    ]
}

/// A view under one light, with its ground truth by one shadow ray a pixel.
pub(crate) struct Row<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) camera: Camera,
    pub(crate) light: Light,
    pub(crate) gbuffer: &'a GBuffer,
    truth: VisibilityImage,
    valid: Vec<bool>,
}

impl<'a> Row<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        casters: &Bvh,
        camera: Camera,
        gbuffer: &'a GBuffer,
        light: Light,
    ) -> Self {
        let settings = ReferenceSettings::default();
        let truth = reference::reference(scene, casters, &light, gbuffer, &settings, &no_progress);
        let truth = truth.expect("nobody cancels").visibility;
        Self { scene, camera, light, gbuffer, truth, valid: reference::valid_pixels(gbuffer, &light) }
    }

    /// Pixels that `variant` gets wrong, of those that are valid.
    pub(crate) fn wrong(&self, variant: Variant, map_size: u32) -> (usize, PreparedPsm<'a>) {
        let technique = Psm::new(PsmParams { variant, map_size, ..Default::default() });
        let (prepared, _) = technique.prepare(self.scene, &self.light, &self.camera, self.gbuffer);
        let mut image = VisibilityImage::new(self.gbuffer.width, self.gbuffer.height);
        prepared.shade(self.gbuffer, &mut image);
        let pixels = image.values.iter().zip(&self.truth.values).zip(&self.valid);
        (pixels.filter(|((v, t), valid)| **valid && (*v - *t).abs() > 0.5).count(), prepared)
    }

    /// The same for every variant, in the order of [`Variant::ALL`].
    pub(crate) fn of_all(&self, map_size: u32) -> Vec<(usize, PreparedPsm<'a>)> {
        Variant::ALL.iter().map(|&variant| self.wrong(variant, map_size)).collect()
    }
}

/// Calls `visit` with scene, direction and row, for each scene of `specs` at `width` × `height` pixels.
#[allow(dead_code, reason = "some of those who include this module bring lights of their own")]
pub(crate) fn visit_rows(specs: &[&str], size: [u32; 2], mut visit: impl FnMut(&str, &str, &Row<'_>)) {
    for spec in specs {
        let setup = scene_core::scenes::build(spec, 0.0).expect("a built-in scene");
        let camera = setup.camera.with_size(size[0], size[1]);
        let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
        let casters = Bvh::casters(&setup.scene);
        for (name, direction) in directions(&camera) {
            let light = Light::Directional { direction, angular_radius: 0.0 };
            visit(spec, name, &Row::new(&setup.scene, &casters, camera, &gbuffer, light));
        }
    }
}
