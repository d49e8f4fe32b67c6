//! The depth rasteriser: milliseconds a map and million triangles a second.
//!
//! Draws a displaced ball of about 200,000 triangles and, where it is found beside the repository, the dragon;
//! no culling, reversed depth, perspective. `threads-1` is the same work in a pool of one thread.

use std::hint::black_box;
use std::path::{Path, PathBuf};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{Affine3A, Vec3};
use gnomon_scene_core::geometry::ObjectFlags;
use gnomon_scene_core::raster::{
    Cull, DepthMap, DepthOptions, RasterScratch, render_depth_into, render_gbuffer_with,
};
use gnomon_scene_core::{Camera, Scene, TriangleMesh};

/// A ball with waves on it, `2 · slices · (stacks − 1)` triangles.
fn ball(slices: u32, stacks: u32) -> TriangleMesh {
    let mut positions = Vec::new();
    for stack in 0..=stacks {
        for slice in 0..slices {
            let theta = std::f32::consts::PI * stack as f32 / stacks as f32;
            let phi = std::f32::consts::TAU * slice as f32 / slices as f32;
            let radius = 1.0 + 0.05 * (9.0 * phi).sin() * (13.0 * theta).sin();
            positions.push(Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * radius);
        }
    }
    let mut triangles = Vec::new();
    for stack in 0..stacks {
        for slice in 0..slices {
            let at = |slice: u32, stack: u32| stack * slices + slice % slices;
            let (a, b) = (at(slice, stack), at(slice + 1, stack));
            let (c, d) = (at(slice, stack + 1), at(slice + 1, stack + 1));
            if stack > 0 {
                triangles.push([a, d, b]);
            }
            if stack + 1 < stacks {
                triangles.push([a, c, d]);
            }
        }
    }
    TriangleMesh::new("ball", positions, triangles)
}

/// The positions and faces of an OBJ file, for what a benchmark needs.
fn obj(path: &Path) -> Option<TriangleMesh> {
    let options = tobj::GPU_LOAD_OPTIONS;
    let (models, _) = tobj::load_obj(path, &options).ok()?;
    let mut mesh = TriangleMesh::new("obj", Vec::new(), Vec::new());
    for model in models {
        let base = mesh.positions.len() as u32;
        mesh.positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        mesh.triangles
            .extend(model.mesh.indices.chunks_exact(3).map(|t| [base + t[0], base + t[1], base + t[2]]));
    }
    Some(mesh)
}

/// A camera that sees the whole scene, filling most of the picture.
fn framed(scene: &Scene, size: u32) -> Camera {
    let (center, radius) = (scene.bounds().center(), scene.bounds().diagonal() * 0.5);
    Camera {
        eye: center + Vec3::new(0.4, 0.5, 1.0).normalize() * radius * 3.0,
        target: center,
        up: Vec3::Y,
        fov_y: 0.6,
        near: radius * 0.1,
        far: f32::INFINITY,
        width: size,
        height: size,
    }
}

fn depth(criterion: &mut Criterion) {
    let mut meshes = vec![ball(450, 225)];
    let dragon = Path::new(env!("CARGO_MANIFEST_DIR")).join(PathBuf::from("../../shared/scenes/dragon.obj"));
    meshes.extend(obj(&dragon).map(|mesh| TriangleMesh { name: "dragon".into(), ..mesh }));
    let pools = [1, 2].map(|threads| {
        (threads, rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads"))
    });
    for mesh in meshes {
        let mut scene = Scene::new();
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a valid mesh");
        let mut group = criterion.benchmark_group(format!("depth/{}", mesh.name));
        group.throughput(Throughput::Elements(mesh.triangles.len() as u64)).sample_size(30);
        for size in [512, 1024, 4096] {
            let matrix = framed(&scene, size).projection_from_world();
            for (threads, pool) in &pools {
                for (name, cull) in [("all", Cull::None), ("culled", Cull::Back)] {
                    let options = DepthOptions { cull, ..Default::default() };
                    let mut scratch = RasterScratch::new();
                    let mut map = DepthMap { width: size, height: size, depth: Vec::new() };
                    let id = BenchmarkId::new(format!("{name}-threads-{threads}"), size);
                    group.bench_function(id, |bencher| {
                        pool.install(|| {
                            bencher.iter(|| {
                                render_depth_into(
                                    black_box(&scene),
                                    matrix,
                                    &options,
                                    &mut scratch,
                                    &mut map,
                                );
                            });
                        });
                    });
                }
            }
        }
        group.finish();
        let camera = framed(&scene, 1024);
        let mut scratch = RasterScratch::new();
        criterion.bench_function(&format!("gbuffer/{}/1024", mesh.name), |bencher| {
            bencher.iter(|| render_gbuffer_with(black_box(&scene), &camera, &mut scratch));
        });
    }
}

criterion_group!(benches, depth);
criterion_main!(benches);
