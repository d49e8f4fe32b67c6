//! Welding, edges and silhouettes: the cost of preparing a mesh for shadow volumes, beside the same edges
//! gathered in a hash map.

use std::collections::HashMap;
use std::hint::black_box;
use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::Vec3;
use gnomon_scene_core::geometry::{EdgeTopology, TriangleMesh, facing, weld};
use gnomon_scene_core::light::LightPoint;

/// A bumpy ball of 2·n² triangles, in the order a generator makes them.
fn ball(n: u32) -> TriangleMesh {
    let point = |i: u32, j: u32| {
        let (u, v) =
            (i as f32 / n as f32 * std::f32::consts::TAU, j as f32 / n as f32 * std::f32::consts::PI);
        let radius = 1.0 + 0.05 * (9.0 * u).sin() * (7.0 * v).sin();
        Vec3::new(v.sin() * u.cos(), v.cos(), v.sin() * u.sin()) * radius
    };
    let positions = (0..=n).flat_map(|j| (0..n).map(move |i| point(i, j))).collect();
    let triangles = (0..n)
        .flat_map(|j| (0..n).map(move |i| (j * n + i, j * n + (i + 1) % n)))
        .flat_map(|(a, b)| [[a, b, a + n], [b, b + n, a + n]])
        .collect();
    TriangleMesh::new("ball", positions, triangles)
}

/// The public dragon, where it is at hand.
fn dragon() -> Option<TriangleMesh> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes/dragon.obj");
    let (models, _) = tobj::load_obj(path, &tobj::GPU_LOAD_OPTIONS).ok()?;
    let mesh = &models.first()?.mesh;
    let positions = mesh.positions.chunks_exact(3).map(Vec3::from_slice).collect();
    let triangles = mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    Some(TriangleMesh::new("dragon", positions, triangles))
}

/// What sorting is held against: each edge's faces in a map.
fn edges_by_map(mesh: &TriangleMesh) -> usize {
    let representative = weld(&mesh.positions).representative;
    let mut edges: HashMap<[u32; 2], Vec<(u32, bool)>> = HashMap::new();
    for (face, t) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|i| representative[i as usize]);
        if a != b && b != c && c != a {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                edges.entry([from.min(to), from.max(to)]).or_default().push((face as u32, from < to));
            }
        }
    }
    edges.len()
}

fn benches(criterion: &mut Criterion) {
    let meshes = [Some(ball(155)), Some(ball(318)), dragon(), Some(ball(660))];
    for mesh in meshes.iter().flatten() {
        let triangles = mesh.triangles.len();
        let label = format!("{}-{}k", mesh.name, triangles / 1000);
        let mut group = criterion.benchmark_group("topology");
        group.sample_size(20).throughput(Throughput::Elements(triangles as u64));

        group.bench_function(BenchmarkId::new("weld", &label), |b| {
            b.iter(|| weld(black_box(&mesh.positions)));
        });
        group.bench_function(BenchmarkId::new("edges", &label), |b| {
            b.iter(|| EdgeTopology::new(black_box(&mesh.positions), &mesh.triangles).unwrap());
        });
        group.bench_function(BenchmarkId::new("edges by hash map", &label), |b| {
            b.iter(|| edges_by_map(black_box(mesh)));
        });

        let edges = EdgeTopology::new(&mesh.positions, &mesh.triangles).unwrap();
        for (name, light) in [
            ("facing, point", LightPoint::At(Vec3::new(3.0, 5.0, 2.0))),
            ("facing, directional", LightPoint::Towards(Vec3::new(0.3, 1.0, 0.2))),
        ] {
            group.bench_function(BenchmarkId::new(name, &label), |b| {
                b.iter(|| facing(black_box(&mesh.positions), &mesh.triangles, light));
            });
        }
        let sides = facing(&mesh.positions, &mesh.triangles, LightPoint::At(Vec3::new(3.0, 5.0, 2.0)));
        group.bench_function(BenchmarkId::new("silhouette", &label), |b| {
            b.iter(|| edges.silhouette(black_box(&sides)).count());
        });
        group.finish();
    }
}

criterion_group!(topology, benches);
criterion_main!(topology);
