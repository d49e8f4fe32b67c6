//! Shadows that cross the edges and corners of a point light's cube: filters go on from one face into the others.
//!
//! A straight edge of a shadow, turned to eight sides, runs over the middle of an edge of the cube and over a corner where three
//! faces meet. V there is known in closed form, so it is compared on both sides, at points closer to each other than a texel:
//! a filter that ended at its face's border would be off by a half, and so would one that read a wrong texel beyond.

use std::f32::consts::{FRAC_PI_4, PI, SQRT_2};

use glam::{Affine3A, Vec2, Vec3};
use gnomon_shadow_map::{Kernel, ShadowMap, ShadowMapParams, Variant};
use scene_core::geometry::ObjectFlags;
use scene_core::{Light, Scene, TriangleMesh};

const LAMP: Vec3 = Vec3::new(0.0, 3.0, 0.0);
const FILTER: u32 = 17;
const TAPS: u32 = 256;

/// Where faces of the cube meet, from the lamp: two on an edge, three at a corner.
const JOINTS: [Vec3; 2] = [Vec3::new(1.0, -1.0, 0.3), Vec3::new(1.0, -1.0, 1.0)];

/// Half a plane at height 1 whose edge is seen from the lamp in a joint's direction.
#[derive(Clone, Copy, Debug)]
struct HalfPlane {
    edge: Vec3,
    /// Away from it, horizontal.
    outwards: Vec3,
}

impl HalfPlane {
    fn all() -> impl Iterator<Item = Self> {
        JOINTS.into_iter().flat_map(|joint| {
            (0..8u8).map(move |eighth| {
                // Not along an axis: edges along columns of texels would be a special case.
                let angle = (f32::from(eighth) + 0.2) * FRAC_PI_4;
                Self { edge: LAMP + joint * 2.0, outwards: Vec3::new(angle.cos(), 0.0, angle.sin()) }
            })
        })
    }

    /// Lies over the ground, and something over the lamp, so that its maps are a cube's.
    fn scene(&self) -> Scene {
        let quad = |name: &str, corners: [Vec3; 4]| {
            TriangleMesh::new(name, corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
        };
        let (along, back) = (Vec3::new(-self.outwards.z, 0.0, self.outwards.x) * 1.5, self.outwards * -1.5);
        let edge = self.edge;
        let ground = [(-12.0, -12.0), (-12.0, 12.0), (12.0, 12.0), (12.0, -12.0)];
        // Not flat, so that it is no backdrop.
        let above = [(-0.5, 5.0, -0.5), (0.5, 5.0, -0.5), (0.0, 5.0, 0.5), (0.0, 6.0, 0.0)].map(Vec3::from);
        let faces = vec![[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let mut scene = Scene::new();
        for mesh in [
            quad("ground", ground.map(|(x, z)| Vec3::new(x, 0.0, z))),
            quad("plate", [edge + along, edge - along, edge - along + back, edge + along + back]),
            TriangleMesh::new("above", above.to_vec(), faces),
        ] {
            scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).expect("a sound mesh");
        }
        scene
    }

    /// How far out of the half plane a line from the lamp downwards crosses its height.
    fn height_of(&self, direction: Vec3) -> f32 {
        self.outwards.dot(LAMP + direction * (2.0 / -direction.y) - self.edge)
    }

    /// Points on the ground around the joint: less than a texel from each other, on both sides of all borders and of the
    /// shadow's edge.
    fn points(&self) -> Vec<Vec3> {
        let middle = LAMP + (self.edge - LAMP) * 1.5;
        let steps = || (-14..=14i8).map(|step| f32::from(step) * 0.0143);
        // A little off the middle, so that none lies on a border itself.
        let at = |x: f32, z: f32| Vec3::new(middle.x + x + 0.0031, 0.0, middle.z + z + 0.0047);
        steps().flat_map(|x| steps().map(move |z| at(x, z))).collect()
    }

    /// V by a variant at each point, and by `expected`; and the largest difference.
    fn compare(
        &self,
        light: Light,
        params: ShadowMapParams,
        expected: impl Fn(&Self, Vec3) -> f32,
        bound: f32,
    ) -> f32 {
        let scene = self.scene();
        let (maps, _) = ShadowMap::new(params).prepare(&scene, &light);
        assert!(maps.maps().len() > 1, "one map holds all");
        let points = self.points();
        let mut found = vec![f32::NAN; points.len()];
        maps.visibility_at(&points, &mut found);
        let (mut worst, mut sides) = (0f32, [0; 3]);
        for (&point, &v) in points.iter().zip(&found) {
            let right = expected(self, point);
            let off = (v - right).abs();
            assert!(off <= bound, "{self:?} at {point}: {v} for {right}, bound {bound}, {params:?}");
            worst = worst.max(off);
            sides[face_of(point - LAMP)] += 1;
        }
        let faces = sides.iter().filter(|&&count| count > 50).count();
        assert_eq!(faces, if self.edge.z > 1.9 { 3 } else { 2 }, "points lie in {sides:?}");
        worst
    }
}

/// The axis of the face of a cube that a direction is in.
fn face_of(direction: Vec3) -> usize {
    let size = direction.abs();
    (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0)
}

/// The share of a window around a receiver, in the plane of its own face, whose lines from the lamp miss the half plane: a
/// square of the filter's width, or the circle in it.
fn share_of_window(half_plane: &HalfPlane, point: Vec3, map_size: u32, is_round: bool) -> f32 {
    const STEPS: u8 = 48;
    let direction = point - LAMP;
    let face = face_of(direction);
    let middle = direction / direction[face].abs();
    let half = FILTER as f32 / map_size as f32;
    let steps = || (0..STEPS).map(|step| (f32::from(step) + 0.5) / f32::from(STEPS) * 2.0 - 1.0);
    let window = steps().flat_map(|a| steps().map(move |b| Vec2::new(a, b)));
    let (mut lit, mut all) = (0.0, 0.0);
    for at in window.filter(|at| !is_round || at.length_squared() <= 1.0) {
        let mut to = middle;
        to[(face + 1) % 3] += at.x * half;
        to[(face + 2) % 3] += at.y * half;
        all += 1.0;
        lit += if half_plane.height_of(to) > 0.0 { 1.0 } else { 0.0 };
    }
    lit / all
}

/// Holds V against `expected` for every half plane, and prints the largest difference.
fn compare_all(
    light: Light,
    params: ShadowMapParams,
    expected: impl Fn(&HalfPlane, Vec3) -> f32 + Copy,
    bound: f32,
) {
    let worst = HalfPlane::all().map(|plane| plane.compare(light, params, expected, bound));
    println!("{} of {bound}", worst.fold(0.0, f32::max));
}

/// The same against shares of windows.
fn compare_windows(light: Light, params: ShadowMapParams, is_round: bool, bound: f32) {
    let expected = |plane: &HalfPlane, point| share_of_window(plane, point, params.map_size, is_round);
    compare_all(light, params, expected, bound);
}

fn point_light(variant: Variant) -> (Light, ShadowMapParams) {
    let params = ShadowMapParams { variant, map_size: 512, filter: FILTER, taps: TAPS, ..Default::default() };
    (Light::Point { position: LAMP }, params)
}

/// What a window's share may be off, for texels asked at their centres. Along the lines of texels that the edge crosses most
/// steeply each line's count is right to half a texel. A texel of another face has its centre up to half a texel off on both of that
/// face's axes; as the receiver's face has them, (1 + s, t) there being (1/(1 + s), t/(1 + s)) here, that is half a texel and, at a corner,
/// half and half together. So the edge, inclined by 45° to the lines at most, moves by up to one and a half along them. The share that
/// is compared with is a sum of 48 steps.
const WINDOW_BOUND: f32 = 2.0 / FILTER as f32 + 1.0 / 96.0;

/// How far from the place that is asked a texel's centre may be, in another face: see the Poisson disks' test.
const OFFSET: f32 = 0.5 * SQRT_2 + 1.118;

#[test]
fn pcf_goes_on_into_other_faces() {
    let (light, params) = point_light(Variant::Pcf);
    compare_windows(light, params, false, WINDOW_BOUND);
}

#[test]
fn object_ids_go_on_into_other_faces() {
    let (light, params) = point_light(Variant::ObjectId);
    compare_windows(light, params, false, WINDOW_BOUND);
}

/// A texel's centre is up to half a diagonal from the place that is asked, and in another face by up to √5/2 more (see
/// [`WINDOW_BOUND`]); an edge that far off adds a stripe as long as the circle is wide. The share of points is right to a row of them.
#[test]
fn poisson_disks_go_on_into_other_faces() {
    let (light, params) = point_light(Variant::Pcf);
    let params = ShadowMapParams { kernel: Kernel::PoissonDisk, ..params };
    let bound = 4.0 / PI * OFFSET / FILTER as f32 + 1.0 / (TAPS as f32).sqrt();
    compare_windows(light, params, true, bound);
}

/// In the window are one surface and nothing: what four moments tell apart. Their bias moves V by 2⁻⁸, and from a face that sees the
/// plate sideways its depths differ, by a share of the way to where nothing is that is far below that.
#[test]
fn moments_go_on_into_other_faces() {
    let (light, params) = point_light(Variant::Moments);
    let params = ShadowMapParams { light_bleeding: 0.0, ..params };
    let bound = WINDOW_BOUND + 2.0 / 256.0;
    compare_windows(light, params, false, bound);
}

/// V is the share of a sphere's disk beside the half plane's edge.
///
/// Bound: a lookup is off as that of a Poisson disk is, where the disk is radius·t/(1 − t) wide, t = 1/3, at
/// the faces' distance of 3; V rises by 2/π of a radius at most. Points of the light are right to a row of them. And the plate is
/// taken for a plane across the line to the light at the mean of its distances, which differ by up to radius/3·sin 54.7°: the
/// disk is as much wider or narrower at its rim, and u·√(1 − u²) ≤ ½.
#[test]
fn pcss_goes_on_into_other_faces() {
    let (radius, map_size) = (0.3, 1024u16);
    let light = Light::Sphere { center: LAMP, radius };
    let (_, params) = point_light(Variant::Pcss);
    let params = ShadowMapParams { map_size: map_size.into(), ..params };
    let lookups = OFFSET * (2.0 / f32::from(map_size)) / (radius * 0.5 / 3.0);
    let depths = 0.5 * radius / 3.0 * 0.816;
    let bound = 2.0 / PI * (lookups + depths) + 1.0 / (TAPS as f32).sqrt();
    let expected = |plane: &HalfPlane, point: Vec3| {
        let to_lamp = LAMP - point;
        let along = Vec3::new(-plane.outwards.z, 0.0, plane.outwards.x);
        let across = (plane.edge - point).cross(along).normalize();
        let tan = |height: f32| (height / to_lamp.length()).asin().tan();
        let u = tan(across.dot(to_lamp).abs()) / tan(radius) * plane.height_of(-to_lamp).signum();
        let u = u.clamp(-1.0, 1.0);
        0.5 + (u * (1.0 - u * u).sqrt() + u.asin()) / PI
    };
    compare_all(light, params, expected, bound);
}
