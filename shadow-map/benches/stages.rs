//! What a hard shadow costs, stage by stage, beside one shadow ray a pixel.
//!
//! `cargo bench -p gnomon-shadow-map` prints both ways to the same image in one run: the map drawn and looked up,
//! and the BVH built and traced. A curved closed mesh of 200,000 triangles stands over a ground.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use glam::{Affine3A, Vec3};
use gnomon_shadow_map::{ShadowMap, ShadowMapParams};
use rayon::prelude::*;
use scene_core::bvh::{Bvh, shadow_origin};
use scene_core::geometry::ObjectFlags;
use scene_core::{Camera, GBuffer, Light, Scene, TriangleMesh, VisibilityImage, raster};

const LIGHT: Light = Light::Point { position: Vec3::new(3.0, 6.0, 2.0) };

/// A sphere with bumps, `rings` × 2·`rings` quads.
fn bumpy_ball(rings: u32) -> TriangleMesh {
    let segments = 2 * rings;
    let positions = (0..=rings)
        .flat_map(|ring| (0..segments).map(move |segment| (ring, segment)))
        .map(|(ring, segment)| {
            let polar = ring as f32 / rings as f32 * std::f32::consts::PI;
            let around = segment as f32 / segments as f32 * std::f32::consts::TAU;
            let radius = 1.0 + 0.1 * (9.0 * polar).sin() * (7.0 * around).sin();
            Vec3::new(polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin()) * radius
                + Vec3::Y * 1.2
        })
        .collect();
    let vertex = |ring: u32, segment: u32| ring * segments + segment % segments;
    let triangles = (0..rings)
        .flat_map(|ring| (0..segments).map(move |segment| (ring, segment)))
        .flat_map(|(r, s)| {
            let [a, b, c, d] = [vertex(r, s), vertex(r + 1, s), vertex(r + 1, s + 1), vertex(r, s + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    TriangleMesh::new("ball", positions, triangles)
}

fn scene() -> Scene {
    let ground = [(-6.0, -6.0), (-6.0, 6.0), (6.0, 6.0), (6.0, -6.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
    let ground = TriangleMesh::new("ground", ground.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let mut scene = Scene::new();
    for mesh in [ground, bumpy_ball(224)] {
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
    }
    scene
}

/// V by one shadow ray a pixel.
fn trace(scene: &Scene, bvh: &Bvh, gbuffer: &GBuffer, visibility: &mut VisibilityImage) {
    let magnitude = scene.bounds().magnitude();
    let width = gbuffer.width as usize;
    visibility.values.par_chunks_mut(width).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            let pixel = row * width + column;
            if gbuffer.is_seen(pixel) {
                let origin = shadow_origin(gbuffer.position[pixel], gbuffer.normal[pixel], magnitude);
                *value = if bvh.is_occluded(origin, LIGHT.center()) { 0.0 } else { 1.0 };
            }
        }
    });
}

fn stages(criterion: &mut Criterion) {
    let scene = scene();
    let camera = Camera {
        eye: Vec3::new(-2.0, 3.5, 6.0),
        target: Vec3::new(0.0, 0.8, 0.0),
        up: Vec3::Y,
        fov_y: 0.7,
        near: 0.1,
        far: f32::INFINITY,
        width: 512,
        height: 512,
    };
    let gbuffer = raster::render_gbuffer(&scene, &camera);
    let mut visibility = VisibilityImage::new(512, 512);
    let technique = ShadowMap::new(ShadowMapParams { map_size: 1024, ..Default::default() });
    println!("{} triangles, 1024² map, 512² image, one light", scene.triangles().len());

    let mut group = criterion.benchmark_group("hard-shadow");
    group.bench_function("map: prepare", |b| b.iter(|| black_box(technique.prepare(&scene, &LIGHT).1)));
    let (maps, _) = technique.prepare(&scene, &LIGHT);
    group.bench_function("map: shade", |b| b.iter(|| maps.shade(&gbuffer, &mut visibility)));
    group.bench_function("map: prepare + shade", |b| {
        b.iter(|| technique.prepare(&scene, &LIGHT).0.shade(&gbuffer, &mut visibility));
    });
    group.sample_size(20);
    let bvh = Bvh::casters(&scene);
    group.bench_function("rays: build", |b| b.iter(|| black_box(Bvh::casters(&scene))));
    group.bench_function("rays: trace", |b| b.iter(|| trace(&scene, &bvh, &gbuffer, &mut visibility)));
    group.bench_function("rays: build + trace", |b| {
        b.iter(|| trace(&scene, &Bvh::casters(&scene), &gbuffer, &mut visibility));
    });
    group.finish();
}

criterion_group!(benches, stages);
criterion_main!(benches);
