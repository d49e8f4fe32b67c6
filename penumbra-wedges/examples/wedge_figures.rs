//! Draws figures 7.4 and 7.5 of the paper in kind. Above: soft shadows of a large sphere light by `interpolated`, `coverage`
//! and `exact`. Below: how many wedges each pixel lies in, for a sphere, a rect and a disk of the same reach over one box.
//!
//! `cargo run --release -p gnomon-penumbra-wedges --example wedge_figures -- FILE.png`

use std::error::Error;
use std::path::Path;

use glam::Vec3;
use gnomon_penumbra_wedges::receiver::{Asked, Receiver};
use gnomon_penumbra_wedges::{Casters, PenumbraWedges, Variant, WedgeParams};
use scene_core::geometry::{ObjectFlags, TriangleMesh};
use scene_core::io::write;
use scene_core::{Camera, GBuffer, Light, Scene, VisibilityImage, raster, scenes};

const WIDTH: usize = 200;
const HEIGHT: usize = 150;

/// A box over a floor.
fn boxed() -> Result<Scene, Box<dyn Error>> {
    let corner = |i: u32| {
        let side = |bit: u32| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
        Vec3::new(side(0), side(1) + 1.2, side(2))
    };
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let floor = [[-6.0, -6.0], [-6.0, 6.0], [6.0, 6.0], [6.0, -6.0]].map(|[x, z]| Vec3::new(x, 0.0, z));
    let mut scene = Scene::new();
    for mesh in [
        TriangleMesh::new("floor", floor.to_vec(), vec![[0, 1, 2], [0, 2, 3]]),
        TriangleMesh::new("box", (0..8).map(corner).collect(), triangles),
    ] {
        scene.add(&mesh, glam::Affine3A::IDENTITY, ObjectFlags::default())?;
    }
    Ok(scene)
}

/// Grey of a pixel: what is not seen is white, what is lit is shaded a little by its normal.
fn grey(gbuffer: &GBuffer, pixel: usize, v: f32) -> [u8; 3] {
    let shade = gbuffer.normal[pixel].y.mul_add(0.2, 0.8);
    [if v.is_nan() { 255 } else { (v.mul_add(0.75, 0.15) * shade * 255.0) as u8 }; 3]
}

fn main() -> Result<(), Box<dyn Error>> {
    let file = std::env::args().nth(1).unwrap_or("figures.png".to_owned());
    let mut pixels = vec![[255_u8; 3]; 3 * WIDTH * 2 * HEIGHT];
    let place = |line: usize, column: usize, pixel: usize| {
        (line * HEIGHT + pixel / WIDTH) * 3 * WIDTH + column * WIDTH + pixel % WIDTH
    };

    let setup = scenes::build("knot:light=1.6", 0.0)?;
    let camera = setup.camera.with_size(WIDTH as u32, HEIGHT as u32);
    let gbuffer = raster::render_gbuffer(&setup.scene, &camera);
    let casters = Casters::new(&setup.scene)?;
    for (column, variant) in
        [Variant::Interpolated, Variant::Coverage, Variant::Exact].into_iter().enumerate()
    {
        let technique = PenumbraWedges::new(WedgeParams { variant, ..Default::default() });
        let (prepared, _) = technique.prepare(&casters, &setup.lights[0], &camera)?;
        let mut image = VisibilityImage::new(camera.width, camera.height);
        prepared.shade(&gbuffer, &mut image);
        for (pixel, &v) in image.values.iter().enumerate() {
            pixels[place(0, column, pixel)] = grey(&gbuffer, pixel, v);
        }
    }

    let scene = boxed()?;
    let camera =
        Camera { eye: Vec3::new(1.5, 4.2, 5.6), target: Vec3::new(0.0, 0.5, 0.0), fov_y: 0.8, ..camera };
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let casters = Casters::new(&scene)?;
    let center = Vec3::new(-1.5, 5.0, 0.5);
    let lights = [
        Light::Sphere { center, radius: 0.7 },
        Light::Rect { center, half_u: Vec3::X * 0.7, half_v: Vec3::Z * 0.7 },
        Light::Disk { center, normal: Vec3::Y, radius: 0.7 },
    ];
    for (column, light) in lights.iter().enumerate() {
        let technique = PenumbraWedges::new(WedgeParams { variant: Variant::Coverage, ..Default::default() });
        let (prepared, _) = technique.prepare(&casters, light, &camera)?;
        let mut image = VisibilityImage::new(camera.width, camera.height);
        prepared.shade(&gbuffer, &mut image);
        let Some(wedges) = prepared.wedges() else { continue };
        for (pixel, &v) in image.values.iter().enumerate() {
            let magnitude = scene.bounds().magnitude();
            let known = Receiver::at(&scene, &gbuffer, &wedges.light, magnitude, pixel);
            let inside = match known {
                Asked::Yes(receiver) => wedges.wedges.iter().filter(|w| w.holds(receiver.place())).count(),
                Asked::Known(_) | Asked::Dark => 0,
            };
            let [r, g, b] = grey(&gbuffer, pixel, v).map(f32::from);
            let tint = (inside as f32 / 4.0).min(1.0) * 0.7;
            pixels[place(1, column, pixel)] =
                [r + (255.0 - r) * tint, g + (150.0 - g) * tint, b + (20.0 - b) * tint].map(|c| c as u8);
        }
    }
    write::color_png(Path::new(&file), &pixels, 3 * WIDTH as u32, 2 * HEIGHT as u32)?;
    Ok(())
}
