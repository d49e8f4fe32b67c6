//! The maps of one light on the GPU: twin of [`light_maps`](crate::light_maps), with a layer a view.

use std::ops::Range;

use scene_core::gpu::{
    Bound, DepthIds, DepthLayers, DepthPass, GpuError, GpuObject, GpuScene, HeldBuffer, Recorder,
};
use scene_core::relevance::{self, CasterChunks, CasterRegion, Receivers};
use scene_core::{Camera, Light, Report, Scene};

use super::filter_maps::LevelTable;
use super::layout::{MapsUniform, ViewUniform};
use crate::cone_reach;
use crate::light_views::{LightView, LightViews, light_views};
use crate::receiver_plane::plane_tolerance;
use crate::view_casters::{looked_up_behind, looked_up_in};
use crate::view_needs::Reach;
use crate::{ShadowMapParams, Variant};

/// Draws the maps of a light, and keeps their textures and what shaders must know of them.
#[derive(Debug)]
pub struct LightMapsOnGpu {
    params: ShadowMapParams,
    depth: DepthPass,
    layers: DepthLayers,
    maps: HeldBuffer,
    views: HeldBuffer,
}

/// What is to be drawn for a light.
#[derive(Clone, Debug)]
pub struct MapsPlan {
    /// A map each.
    pub views: Vec<LightView>,
    /// Ranges of triangles.
    pub casters: Vec<Range<u32>>,
    /// Those that each view holds for one camera, where that was asked for.
    pub of_views: Option<Vec<Vec<Range<u32>>>>,
    /// [`plane_tolerance`].
    pub tolerance: f32,
}

/// What [`LightMapsOnGpu::draw`] recorded: the first three bindings of every lookup, and how many views there are.
#[derive(Clone, Debug)]
pub struct DrawnMaps {
    /// `Maps` of `light_views.wesl`.
    pub maps: wgpu::Buffer,
    /// A table of `LightView`.
    pub views: wgpu::Buffer,
    /// The triangle of every texel, a layer a view.
    pub ids: Bound,
    /// Views.
    pub count: u32,
}

impl LightMapsOnGpu {
    /// Makes the pipelines.
    pub fn new(device: &wgpu::Device, params: ShadowMapParams) -> Self {
        Self {
            params,
            depth: DepthPass::new(device, DepthIds::Triangle, None),
            layers: DepthLayers::new(DepthIds::Triangle),
            maps: HeldBuffer::uniform("maps"),
            views: HeldBuffer::storage("views of the light"),
        }
    }

    /// Chooses the views of `light` and what is drawn into them, for any camera. Nothing is recorded.
    pub fn plan(&self, scene: &GpuScene<'_>, light: &Light, report: &mut Report) -> MapsPlan {
        self.plan_with(scene, light, None, report)
    }

    /// As [`plan`](Self::plan); with `view_dependent` and `skip` each view holds only what surfaces that `camera` sees are looked
    /// up in. A face of a cube that nobody looks at draws nothing.
    pub fn plan_for_view(
        &self,
        scene: &GpuScene<'_>,
        light: &Light,
        camera: &Camera,
        report: &mut Report,
    ) -> MapsPlan {
        let ShadowMapParams { skip, view_dependent, .. } = self.params;
        self.plan_with(scene, light, (skip && view_dependent).then_some(camera), report)
    }

    fn plan_with(
        &self,
        scene: &GpuScene<'_>,
        light: &Light,
        camera: Option<&Camera>,
        report: &mut Report,
    ) -> MapsPlan {
        let geometry = scene.geometry_or_boxes();
        let tolerance = plane_tolerance(geometry.bounds(), light);
        // A box in the place of an object may be convex where the object is not.
        let has_solids = self.params.variant == Variant::MultiView && scene.geometry.is_some();
        let told_apart = if has_solids { relevance::told_apart_with_solids } else { relevance::told_apart };
        let casters = told_apart(&geometry, light, tolerance);
        let LightViews { views, skipped_faces } =
            light_views(&geometry, light, &casters.drawn, self.params.skips_faces());
        report.skip("casters", casters.backdrops.len() as u64);
        report.skip("faces", skipped_faces);
        let is_drawn = |id: usize| {
            let object = &geometry.objects()[id];
            object.flags.casts && !casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        };
        let objects = scene.objects.iter().enumerate().filter(|(id, _)| is_drawn(*id));
        let drawn: Vec<_> = objects.map(|(_, object)| object).collect();
        let of_views = camera.and_then(|camera| {
            // Of a box nothing is known but that the object lies within.
            let is_whole = scene.geometry.is_some();
            let receivers = if is_whole {
                Receivers::seen_closely_by(&geometry, camera, light, &CasterChunks::default())
            } else {
                Receivers::seen_by(&geometry, camera, light)
            };
            self.of_views((&geometry, is_whole), light, &receivers, &views, &drawn, report)
        });
        let casters = drawn.into_iter().map(|object| object.triangles.clone()).collect();
        MapsPlan { views, casters, of_views, tolerance }
    }

    /// Of the objects `drawn` those that each view holds for `receivers`, as a whole; `None` where a lookup may read any texel.
    /// `is_whole` says whether `geometry` holds triangles, and not boxes in their place.
    fn of_views(
        &self,
        (geometry, is_whole): (&Scene, bool),
        light: &Light,
        receivers: &Receivers,
        views: &[LightView],
        drawn: &[&GpuObject],
        report: &mut Report,
    ) -> Option<Vec<Vec<Range<u32>>>> {
        let size = self.params.map_size;
        let reach = Reach::of_lookup(&self.params, light)?;
        let is_face = views.len() > 1;
        let sine = match reach {
            // An object may be anywhere in the box that stands for it.
            Reach::Cone if is_face && !is_whole => return None,
            Reach::Cone if is_face => cone_reach::sine_beside(geometry, light, receivers, size)?,
            _ => 0.0,
        };
        let touched = |region: &CasterRegion| {
            drawn.iter().copied().filter(|object| region.touches(&object.bounds)).collect::<Vec<_>>()
        };
        let all_or_none = |seen: &Receivers| if seen.is_empty() { Vec::new() } else { drawn.to_vec() };
        let of = |view: &LightView| match reach {
            Reach::Texels(reach) => {
                let mut seen = receivers.clone();
                if is_face {
                    seen = seen.inside(&looked_up_in(view, size, reach)?);
                }
                if reads_whole_maps(self.params.variant) {
                    return Some(all_or_none(&seen));
                }
                Some(touched(&looked_up_behind(geometry, light, &seen, &[*view], size, reach)))
            }
            Reach::Cone if is_face => {
                let sides = cone_reach::looked_up_in(view, sine, size)?;
                Some(all_or_none(&receivers.clone().inside(&sides)))
            }
            Reach::Cone => {
                let window = cone_reach::read_texels(view, light, receivers, size)?;
                Some(touched(&CasterRegion::inside(geometry, &view.sides_of(&window, size))))
            }
        };
        let kept = views.iter().map(of).collect::<Option<Vec<_>>>()?;
        let triangles =
            |objects: &[&GpuObject]| objects.iter().map(|o| o.triangles.len() as u64).sum::<u64>();
        for kept in &kept {
            report.skip("casters outside view", (drawn.len() - kept.len()) as u64);
            report.skip("caster triangles outside view", triangles(drawn) - triangles(kept));
            report.skip("undrawn faces", u64::from(kept.is_empty()));
        }
        let ranges =
            |kept: Vec<&GpuObject>| kept.into_iter().map(|object| object.triangles.clone()).collect();
        Some(kept.into_iter().map(ranges).collect())
    }

    /// Records the drawing of the maps, timed as `stage`. A light without casters has no views, and a map that is not
    /// looked up.
    ///
    /// # Errors
    /// More maps or texels than the device has.
    pub fn draw(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &GpuScene<'_>,
        plan: &MapsPlan,
        stage: &str,
    ) -> Result<Option<DrawnMaps>, GpuError> {
        let count = plan.views.len() as u32;
        self.layers.resize(recorder.device, self.params.map_size, count)?;
        let projections = plan.views.iter().map(|view| view.projection_from_world);
        let mut targets = self.layers.targets(projections, Some(&plan.casters));
        // What a view does not hold is cleared all the same: layers are kept from frame to frame.
        for (target, casters) in targets.iter_mut().zip(plan.of_views.iter().flatten()) {
            target.triangles = Some(casters);
        }
        self.depth.record(recorder, stage, scene, &targets);

        let device = recorder.device;
        let table = LevelTable::new(self.params.map_size);
        let maps = MapsUniform::new(count, plan.tolerance, &self.params, &table);
        let uniforms: Vec<_> = plan.views.iter().map(ViewUniform::new).collect();
        let maps = self.maps.get(device, bytemuck::bytes_of(&maps));
        let views = self.views.get(device, bytemuck::cast_slice(&uniforms));
        Ok(self.layers.bound_ids().map(|ids| DrawnMaps { maps, views, ids, count }))
    }

    /// The maps, one a layer, and the triangles they see.
    pub fn layers(&self) -> &DepthLayers {
        &self.layers
    }
}

/// Whether texels that are not looked up count, too: those of its pyramid.
fn reads_whole_maps(variant: Variant) -> bool {
    variant == Variant::Pcss
}
