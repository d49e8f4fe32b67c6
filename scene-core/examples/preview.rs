//! A look at a built-in scene: a shaded PNG with the hard shadow of the light's middle.
//!
//! ```text
//! cargo run --release --example preview -- chess:position=1 chess.png [time in seconds]
//! ```
//!
//! The rasteriser says what each pixel sees, one shadow ray a pixel whether the light's middle is seen from
//! there. Objects get colours of their own.

use std::error::Error;
use std::f32::consts::TAU;
use std::time::{Duration, Instant};

use glam::Vec3;
use gnomon_scene_core::light::LightPoint;
use gnomon_scene_core::raster::render_gbuffer;
use gnomon_scene_core::{GBuffer, Light, Scene, scenes};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;
use rayon::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [spec, file, rest @ ..] = &arguments[..] else {
        println!("usage: preview SCENE[:key=value,…] FILE.png [TIME]\n\nscenes:");
        for scene in scenes::all() {
            println!("  {:<10} {}", scene.name, scene.summary);
            for p in scene.parameters {
                println!("      {} = {} ({} to {}): {}", p.name, p.default, p.min, p.max, p.doc);
            }
        }
        return Ok(());
    };
    let time = rest.first().map_or(Ok(0.0), |t| t.parse())?;

    let start = Instant::now();
    let setup = scenes::build(spec, time)?;
    let built = start.elapsed();
    let gbuffer = render_gbuffer(&setup.scene, &setup.camera);
    let shadows = Shadows::new(&setup.scene);
    let pixels: Vec<[u8; 3]> = (0..gbuffer.pixel_count())
        .into_par_iter()
        .map(|pixel| shade(&gbuffer, pixel, &setup.lights[0], &shadows))
        .collect();
    image::save_buffer(file, pixels.as_flattened(), gbuffer.width, gbuffer.height, image::ColorType::Rgb8)?;
    println!(
        "{}: {} vertices, {} triangles, {} meshes; built in {built:.1?}, all in {:.1?}",
        setup.name,
        setup.scene.positions().len(),
        setup.scene.triangles().len(),
        setup.scene.objects().len(),
        start.elapsed(),
    );
    Ok(())
}

fn shade(gbuffer: &GBuffer, pixel: usize, light: &Light, shadows: &Shadows<'_>) -> [u8; 3] {
    if !gbuffer.is_seen(pixel) {
        return [168, 190, 214];
    }
    let (position, normal) = (gbuffer.position[pixel], gbuffer.normal[pixel]);
    let (towards, _) = light.center().ray_from(position);
    let facing = normal.dot(towards.normalize_or_zero()).max(0.0);
    let lit = facing > 0.0 && light.reaches(position) && !shadows.blocked(position, normal, light.center());
    let ambient = 0.2 + 0.08 * normal.y;
    let shaded = colour(gbuffer.object[pixel]) * (ambient + if lit { 0.85 * facing } else { 0.0 });
    // Linear light to sRGB, near enough.
    shaded.to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0) as u8)
}

/// Pale hues, a golden turn apart; the first object is white.
fn colour(object: u32) -> Vec3 {
    if object == 0 {
        return Vec3::splat(0.8);
    }
    let hue = (object as f32 * 0.618_034).fract();
    let channel = |shift: f32| 0.62 + 0.22 * ((hue + shift) * TAU).cos();
    Vec3::new(channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0))
}

struct Shadows<'a> {
    scene: &'a Scene,
    triangles: Vec<Triangle>,
    tree: Bvh2,
}

impl<'a> Shadows<'a> {
    fn new(scene: &'a Scene) -> Self {
        let corners = (0..scene.triangles().len()).map(|i| scene.corners(i).map(Into::into));
        let triangles: Vec<_> = corners.map(|[v0, v1, v2]| Triangle { v0, v1, v2 }).collect();
        let tree = build_bvh2_from_tris(&triangles, BvhBuildParams::fast_build(), &mut Duration::default());
        Self { scene, triangles, tree }
    }

    fn blocked(&self, position: Vec3, normal: Vec3, light: LightPoint) -> bool {
        // The origin is lifted by a few units in the last place of the largest coordinate there is.
        let lift = self.scene.bounds().magnitude() * 2f32.powi(-21);
        let origin = position + normal * lift;
        let (direction, end) = light.ray_from(origin);
        let ray = Ray::new(origin.into(), direction.into(), 0.0, end.min(f32::MAX));
        let mut blocked = false;
        self.tree.ray_traverse_anyhit(ray, |ray, node| {
            let triangle = self.tree.primitive_indices[node] as usize;
            let t = self.triangles[triangle].intersect(ray);
            blocked |= t > 0.0 && t < end && self.is_solid(triangle, (ray.origin + ray.direction * t).into());
        });
        blocked
    }

    fn is_solid(&self, triangle: usize, point: Vec3) -> bool {
        let object = &self.scene.objects()[self.scene.object_of(triangle) as usize];
        let Some(mask) = &object.alpha else { return object.flags.casts };
        let [a, b, c] = self.scene.corners(triangle);
        let normal = (b - a).cross(c - a);
        let share = |u: Vec3, v: Vec3| u.cross(v).dot(normal) / normal.length_squared();
        let (v, w) = (share(point - a, c - a), share(b - a, point - a));
        let [uv_a, uv_b, uv_c] = self.scene.triangles()[triangle].map(|i| self.scene.uvs()[i as usize]);
        object.flags.casts && mask.is_solid(uv_a * (1.0 - v - w) + uv_b * v + uv_c * w)
    }
}
