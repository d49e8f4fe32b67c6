//! Objects that stand side by side, so that many are told outside or inside of a region at once.

use super::polyhedron::side_of_all;
use super::{HalfSpace, Side};
use crate::Scene;
use crate::geometry::Aabb;

/// Objects of a group, at most. A scene of no more has no groups.
const GROUP: usize = 32;

/// The objects of a scene that have triangles, by place: groups with the box around each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ObjectGroups {
    /// Objects of the scene when they were grouped: those below this id are in a group, or without triangles.
    known: usize,
    groups: Vec<(Aabb, Vec<u32>)>,
}

impl ObjectGroups {
    pub(super) fn new(scene: &Scene) -> Self {
        let objects = scene.objects();
        let mut groups = Self::default();
        let ids = (0..).zip(objects).filter(|(_, object)| !object.bounds.is_empty());
        let mut ids: Vec<u32> = ids.map(|(id, _)| id).collect();
        if ids.len() > GROUP {
            groups.known = objects.len();
            groups.split(scene, &mut ids);
        }
        groups
    }

    /// Halves along the longest side of the box around them, until they are few.
    fn split(&mut self, scene: &Scene, ids: &mut [u32]) {
        let bounds_of = |id: u32| scene.objects()[id as usize].bounds;
        let bounds = ids.iter().map(|&id| bounds_of(id)).fold(Aabb::EMPTY, Aabb::union);
        if ids.len() <= GROUP {
            self.groups.push((bounds, ids.to_vec()));
            return;
        }
        let axis = bounds.size().max_position();
        let middle = ids.len() / 2;
        let place = |id: u32| bounds_of(id).center()[axis];
        ids.select_nth_unstable_by(middle, |&a, &b| place(a).total_cmp(&place(b)).then(a.cmp(&b)));
        let (low, high) = ids.split_at_mut(middle);
        self.split(scene, low);
        self.split(scene, high);
    }

    pub(super) fn bytes(&self) -> usize {
        let ids: usize = self.groups.iter().map(|(_, ids)| size_of_val(ids.as_slice())).sum();
        size_of_val(self.groups.as_slice()) + ids
    }

    /// Where each object lies to what is inside of all `planes`, by id; one without triangles is outside. Objects that are in no group
    /// are asked one by one.
    pub(super) fn sides(&self, scene: &Scene, planes: &[HalfSpace]) -> Vec<Side> {
        let objects = scene.objects();
        let side_of = |bounds: &Aabb| side_of_all(planes, bounds);
        let (known, others) = objects.split_at(self.known.min(objects.len()));
        let mut sides = vec![Side::Outside; known.len()];
        for (bounds, ids) in &self.groups {
            let side = side_of(bounds);
            if side == Side::Outside {
                continue;
            }
            for id in ids.iter().map(|&id| id as usize).filter(|&id| id < known.len()) {
                sides[id] = if side == Side::Inside { side } else { side_of(&known[id].bounds) };
            }
        }
        sides.extend(others.iter().map(|object| side_of(&object.bounds)));
        sides
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, DVec3, Vec3};

    use super::*;
    use crate::geometry::ObjectFlags;
    use crate::{TriangleMesh, scenes};

    /// Of a scene that has grown since, the objects that are in no group are told by their own boxes, too.
    #[test]
    fn objects_in_no_group_are_not_left_out() {
        let mut scene = scenes::build("forest:triangles=20000", 0.0).unwrap().scene;
        let (groups, before) = (ObjectGroups::new(&scene), scene.objects().len());
        let mesh = TriangleMesh::new("new", vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
        scene.add(&mesh, Affine3A::IDENTITY, ObjectFlags::default()).unwrap();
        for (offset, side) in [(2.0, Side::Inside), (0.5, Side::Across), (-1.0, Side::Outside)] {
            let sides = groups.sides(&scene, &[HalfSpace { normal: DVec3::X, offset }]);
            assert_eq!((sides.len(), sides[before]), (before + 1, side));
        }
    }

    #[test]
    fn groups_say_of_each_object_what_its_box_says() {
        let setup = scenes::build("forest:triangles=20000", 0.0).unwrap();
        let scene = &setup.scene;
        let groups = ObjectGroups::new(scene);
        let mut ids: Vec<_> = groups.groups.iter().flat_map(|(_, ids)| ids.iter().copied()).collect();
        ids.sort_unstable();
        assert!(groups.groups.len() > 1 && groups.groups.iter().all(|(_, ids)| ids.len() <= GROUP));
        assert_eq!(ids, (0..scene.objects().len() as u32).collect::<Vec<_>>());
        let mut counts = [0; 3];
        for (normal, offset) in [(DVec3::X, 1.0), (DVec3::NEG_Z, 2.0), (DVec3::new(0.6, 0.0, 0.8), -3.0)] {
            let planes = [HalfSpace { normal, offset }, HalfSpace { normal: DVec3::Y, offset: 4.0 }];
            let sides = groups.sides(scene, &planes);
            assert_eq!(sides, ObjectGroups::default().sides(scene, &planes));
            sides.iter().for_each(|side| counts[*side as usize] += 1);
        }
        assert!(counts.iter().all(|&count| count > 0), "{counts:?}");
    }
}
