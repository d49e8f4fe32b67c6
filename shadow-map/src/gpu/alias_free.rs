//! `alias-free` on the GPU: the irregular z-buffer in compute. Twin of [`alias_free`](crate::alias_free), with cells filled by
//! atomics in the place of a tree.
//!
//! 1. `shade.receivers`: the window around all receivers, as a light's one direction or the faces of a cube around it see them;
//!    a count a cell; places; the receivers, sorted by cell.
//! 2. `shade.casters`: each triangle is tested against the receivers of the cells that it covers. Those before many are listed
//!    in slices of cells.
//! 3. `shade.large`: these, a workgroup a slice.
//! 4. `shade.lookup`: V from a bit a pixel.
//!
//! # What is exact
//! Arithmetic is in f32, so a receiver closer to a shadow's border than rounding, about 2⁻²¹ of the largest coordinate across the
//! ray, may fall to the other side. Edges that triangles share leak no light. Nothing shadows itself: see `irregular.wesl`.
//!
//! # Cost
//! Receivers that crowd into few cells, as under a light that grazes what the camera sees, make lists long.

use scene_core::gpu::{
    Bound, ComputePass, DepthIds, DepthLayers, GpuCutouts, GpuGBuffer, GpuScene, GpuShadowQuery, HeldBuffer,
    HeldGroup, Receivers, Recorder, SceneBindings, SceneHandles, VisibilityPass, VisibilityPassParts,
    WorkBuffer, binding,
};
use scene_core::light::LightPoint;
use scene_core::technique::TechniqueError;
use scene_core::{Camera, Report};

use super::layout::{CasterRow, IrregularUniform};
use super::{VariantOnGpu, not_prepared, shaders};

/// Pixels or cells a side of a workgroup.
const GROUP: u32 = 8;
/// Triangles of a workgroup.
const TRIANGLES: u32 = 64;
/// Receivers a cell has on average: fewer make more cells to visit a triangle, more make more tests.
const RECEIVERS_A_CELL: f32 = 4.0;
/// Cells a side at most.
const MAX_SIDE: u32 = 1024;
/// Words of `work` before those of cells.
pub(super) const FIRST_CELL: u32 = 64;
/// Slices of cells that there is room to list, and the first of the words that say how many workgroups go through them.
pub(super) const MOST_LISTED: u32 = 1 << 19;
pub(super) const WORKGROUPS: u32 = 4;
/// Workgroups that every device dispatches along one axis.
pub(super) const MAX_GROUPS: u32 = 65_535;

/// The variant on one device.
#[derive(Debug)]
pub(super) struct AliasFree {
    /// None: there are no maps.
    layers: DepthLayers,
    settings: HeldBuffer,
    casters: HeldBuffer,
    work: WorkBuffer,
    placed: WorkBuffer,
    group: HeldGroup,
    begin: ComputePass,
    bound: ComputePass,
    count: ComputePass,
    place_cells: ComputePass,
    place: ComputePass,
    cast: ComputePass,
    end_list: ComputePass,
    cast_large: ComputePass,
    workgroups: WorkBuffer,
    first_dark: HeldBuffer,
    own: HeldGroup,
    pass: VisibilityPass,
    scene: SceneBindings,
    receivers: Receivers,
    /// What stands for cut-outs where there are none.
    no_cutouts: [HeldBuffer; 2],
    prepared: Option<Prepared>,
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    scene: SceneHandles,
    casters: wgpu::Buffer,
    /// But for what depends on the picture's size.
    uniform: IrregularUniform,
}

impl AliasFree {
    pub(super) fn new(device: &wgpu::Device, visibility: wgpu::TextureFormat) -> Self {
        let stages = wgpu::ShaderStages::COMPUTE | wgpu::ShaderStages::FRAGMENT;
        let scene = SceneBindings::new(device, stages);
        let receivers = Receivers::new(device);
        let types = [binding::UNIFORM, binding::STORAGE_WRITE, binding::STORAGE_WRITE, binding::STORAGE];
        let group = HeldGroup::new(device, "receivers by cell", wgpu::ShaderStages::COMPUTE, &types);
        let groups = [
            Some(group.layout()),
            Some(&scene.triangles_layout),
            Some(&scene.cutouts_layout),
            Some(receivers.layout()),
        ];
        let pass = |entry| ComputePass::new(device, entry, shaders::IRREGULAR, entry, &groups);
        let own = HeldGroup::new(
            device,
            "dark receivers",
            wgpu::ShaderStages::FRAGMENT,
            &[binding::UNIFORM, binding::STORAGE],
        );
        let lookup = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "shadow-map alias-free",
                wgsl: shaders::ALIAS_FREE,
                fragment: "shade_alias_free",
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: visibility,
            },
        );
        Self {
            layers: DepthLayers::new(DepthIds::None),
            settings: HeldBuffer::uniform("irregular"),
            casters: HeldBuffer::storage("casters"),
            work: WorkBuffer::new("cells of receivers"),
            placed: WorkBuffer::new("receivers"),
            begin: pass("begin_windows"),
            bound: pass("bound_receivers"),
            count: pass("count_receivers"),
            place_cells: pass("place_cells"),
            place: pass("place_receivers"),
            cast: pass("cast_shadows"),
            end_list: pass("end_list"),
            cast_large: pass("cast_large"),
            workgroups: WorkBuffer::with_usage("workgroups of large triangles", wgpu::BufferUsages::INDIRECT),
            group,
            first_dark: HeldBuffer::uniform("dark receivers"),
            own,
            pass: lookup,
            scene,
            receivers,
            no_cutouts: ["no texture coordinates", "no masks"].map(HeldBuffer::storage),
            prepared: None,
        }
    }
}

/// The triangles that cast, in runs of one object where that has a mask.
fn caster_rows(scene: &GpuScene<'_>) -> (Vec<CasterRow>, u32) {
    let mut casters: Vec<_> = (0..)
        .zip(scene.objects)
        .filter(|(_, object)| object.flags.casts && !object.triangles.is_empty())
        .map(|(id, object)| (object.triangles.clone(), id, object.has_mask && scene.cutouts.is_some()))
        .collect();
    casters.sort_unstable_by_key(|(triangles, ..)| triangles.start);
    let (mut rows, mut before, mut end): (Vec<CasterRow>, u32, u32) = (Vec::new(), 0, 0);
    for (triangles, object, has_mask) in casters {
        let goes_on = end == triangles.start && rows.last().is_some_and(|row| row.has_mask == 0);
        if has_mask || !goes_on {
            rows.push(CasterRow { before, first: triangles.start, object, has_mask: u32::from(has_mask) });
        }
        before += triangles.end - triangles.start;
        end = triangles.end;
    }
    (rows, before)
}

impl VariantOnGpu for AliasFree {
    fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let device = recorder.device;
        let mut report = Report::default();
        let (rows, casters) = report.time("prepare.casters", |_| caster_rows(&query.scene));
        let mut magnitude = query.scene.bounds.magnitude();
        let mut uniform =
            IrregularUniform { windows: 6, casters, rows: rows.len() as u32, ..bytemuck::Zeroable::zeroed() };
        match query.light.center() {
            LightPoint::At(place) => magnitude = magnitude.max(place.abs().max_element()),
            LightPoint::Towards(to_light) => {
                (uniform.x, uniform.y) = to_light.normalize_or(glam::Vec3::Y).any_orthonormal_pair();
                uniform.windows = 1;
            }
        }
        uniform.magnitude = magnitude;
        self.prepared = Some(Prepared {
            scene: SceneHandles::new(&query.scene),
            casters: self.casters.get(device, bytemuck::cast_slice(&rows)),
            uniform,
        });
        self.receivers.prepare(recorder, query);
        Ok(report)
    }

    fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let device = recorder.device;
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let pixels = camera.width * camera.height;
        let side = (pixels as f32 / RECEIVERS_A_CELL).sqrt().ceil().clamp(1.0, MAX_SIDE as f32) as u32;
        let uniform = IrregularUniform { side, width: camera.width, ..prepared.uniform };
        let first_dark = FIRST_CELL + 2 * uniform.windows * side * side;
        let first_listed = first_dark + pixels.div_ceil(32);
        let words = first_listed + 2 * MOST_LISTED;
        let work = self.work.get(device, u64::from(words) * 4)?;
        let placed = self.placed.get(device, u64::from(pixels) * 16)?;
        let settings = self.settings.get(device, bytemuck::bytes_of(&uniform));
        let bound: [Bound; 4] =
            [settings.into(), work.clone().into(), placed.into(), prepared.casters.clone().into()];
        let own = self.group.get(device, &bound);

        let [uvs, masks] = &mut self.no_cutouts;
        let nothing = [uvs.get(device, &[]), masks.get(device, &[])];
        let scene = prepared.scene.view();
        let [uvs, masks] = &nothing;
        let cutouts = scene.cutouts.unwrap_or(GpuCutouts { uvs, masks });
        let scene = self.scene.groups(device, &GpuScene { cutouts: Some(cutouts), ..scene });
        let groups = [Some(&own), Some(&scene.triangles), scene.cutouts.as_ref(), Some(&receivers)];

        recorder.encoder.clear_buffer(&work, 0, Some(u64::from(first_listed) * 4));
        let all = [camera.width.div_ceil(GROUP), camera.height.div_ceil(GROUP), 1];
        let cells = [side.div_ceil(GROUP), side.div_ceil(GROUP), uniform.windows];
        let stages = [
            (&self.begin, [1; 3]),
            (&self.bound, all),
            (&self.count, all),
            (&self.place_cells, cells),
            (&self.place, all),
        ];
        for (pass, workgroups) in stages {
            pass.record(recorder, "shade.receivers", &groups, workgroups);
        }
        let needed = uniform.casters.div_ceil(TRIANGLES);
        let columns = needed.min(MAX_GROUPS);
        let casts = [columns, needed.div_ceil(columns.max(1)), uniform.windows];
        self.cast.record(recorder, "shade.casters", &groups, casts);
        self.end_list.record(recorder, "shade.large", &groups, [1; 3]);
        let workgroups = self.workgroups.get(device, 16)?;
        recorder.encoder.copy_buffer_to_buffer(&work, u64::from(WORKGROUPS) * 4, &workgroups, 0, 12);
        self.cast_large.record_indirect(recorder, "shade.large", &groups, &workgroups);

        let first_dark = self.first_dark.get(device, bytemuck::bytes_of(&[first_dark, 0, 0, 0]));
        let own = self.own.get(device, &[first_dark.into(), work.into()]);
        self.pass.record(recorder, "shade.lookup", &own, &scene, &receivers, visibility);
        Ok(Report { bytes: self.work.bytes() + self.placed.bytes(), ..Default::default() })
    }

    fn layers(&self) -> &DepthLayers {
        &self.layers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene_core::geometry::{Aabb, ObjectFlags};
    use scene_core::gpu::{GpuObject, testing};

    #[test]
    fn runs_of_casters_follow_one_another() {
        let Some(gpu) = testing::gpu() else { return };
        let mut buffer = HeldBuffer::storage("test");
        let buffer = buffer.get(&gpu.device, &[]);
        let object = |triangles, casts, has_mask| GpuObject {
            triangles,
            bounds: Aabb::EMPTY,
            flags: ObjectFlags { casts, ..Default::default() },
            has_mask,
        };
        let objects = [
            object(8..10, true, false),
            object(0..3, true, false),
            object(3..5, true, false),
            object(5..8, true, true),
            object(10..12, false, false),
            object(12..13, true, false),
        ];
        let scene = GpuScene {
            positions: &buffer,
            triangles: &buffer,
            objects: &objects,
            bounds: Aabb::EMPTY,
            cutouts: Some(GpuCutouts { uvs: &buffer, masks: &buffer }),
            geometry: None,
        };
        let (rows, count) = caster_rows(&scene);
        let rows: Vec<_> = rows.iter().map(|row| (row.before, row.first, row.object, row.has_mask)).collect();
        assert_eq!(rows, [(0, 0, 1, 0), (5, 5, 3, 1), (8, 8, 0, 0), (10, 12, 5, 0)]);
        assert_eq!(count, 11);
    }
}
