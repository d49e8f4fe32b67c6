//! The GPU path: the passes of [`cpu`](crate::cpu) under the same names, recorded into the caller's encoder.
//!
//! Pass 1 is shadow-map's. Every later one is a full-screen pass that reads the images of those before it, but for the pyramid,
//! which compute passes make. Bind groups are alike in all of them: 0 holds the map, the settings, the pyramid and the images.
//! Which passes follow one another is decided by the settings alone (`passes`), so nothing is read back.
//!
//! V differs from the CPU's where a point of the kernel falls on the border of two pixels or texels, and rounding takes the
//! other one; where the map's texel on a caster's outline holds another triangle; and where a pixel stands so near to one of
//! the decisions of [`physical`](crate::physical) that rounding turns it.

mod backs;
mod images;
pub mod layout;
mod passes;
mod pyramid;
pub mod shaders;

use gnomon_shadow_map::gpu::filter_maps::FilterMapsOnGpu;
use gnomon_shadow_map::gpu::light_maps::LightMapsOnGpu;
use gnomon_shadow_map::{ShadowMapParams, Variant as MapVariant};
use scene_core::gpu::{
    Bound, DepthLayers, GpuError, GpuGBuffer, GpuShadowQuery, GpuShadowTechnique, HeldBuffer, HeldGroup,
    Receivers, Recorder, SceneBindings, SceneGroups, VisibilityPass, VisibilityPassParts, binding,
};
use scene_core::technique::{Params as _, TechniqueError};
use scene_core::{Camera, Light, Report};

use crate::kernel::Kernel;
use crate::{ContactHardening, ContactHardeningParams, Scaling};
use backs::BacksOnGpu;
use images::{Image, ONE, PAIRS};
use layout::SettingsTable;
use passes::{Slot, Step, steps};
use pyramid::PyramidOnGpu;

/// The technique on one device: pipelines, and the map of the light prepared last.
pub struct ContactHardeningOnGpu {
    technique: ContactHardening,
    maps: LightMapsOnGpu,
    filter: FilterMapsOnGpu,
    /// Where closed casters are solid.
    backs: Option<BacksOnGpu>,
    scene: SceneBindings,
    receivers: Receivers,
    source: Option<SourceOnGpu>,
    settings: HeldBuffer,
    pyramid: PyramidOnGpu,
    images: Images,
    passes: Vec<Pass>,
    prepared: Option<Prepared>,
}

/// Whose hard shadows are blurred.
struct SourceOnGpu {
    technique: Box<dyn GpuShadowTechnique>,
    image: Image,
}

/// A step with its pipeline.
#[derive(Debug)]
struct Pass {
    step: Step,
    pipeline: VisibilityPass,
    uniform: HeldBuffer,
    own: HeldGroup,
}

/// Images between passes.
#[derive(Debug)]
struct Images {
    distance: Image,
    a: Image,
    b: Image,
    plan: Image,
}

impl Images {
    fn new() -> Self {
        let pairs = |label| Image::new(label, PAIRS);
        Self { distance: pairs("distance map"), a: pairs("blur"), b: pairs("blur"), plan: pairs("plan") }
    }

    /// The image of a slot; `None` where it is the caller's.
    fn get(&mut self, device: &wgpu::Device, slot: Slot, size: [u32; 2]) -> Option<wgpu::TextureView> {
        let image = match slot {
            Slot::Surface | Slot::Visibility => return None,
            Slot::Distance => &mut self.distance,
            Slot::A => &mut self.a,
            Slot::B => &mut self.b,
            Slot::Plan => &mut self.plan,
        };
        Some(image.get(device, size))
    }

    fn bytes(&self) -> u64 {
        [&self.distance, &self.a, &self.b, &self.plan].map(Image::bytes).iter().sum()
    }
}

/// What `prepare` leaves to `shade`.
#[derive(Debug)]
struct Prepared {
    /// The first four bindings of group 0.
    maps: Vec<Bound>,
    /// The last.
    backs: Bound,
    scene: SceneGroups,
    kernel: Kernel,
    fine: Kernel,
    is_parallel: bool,
}

impl ContactHardeningOnGpu {
    /// Makes the pipelines. `visibility` is the format of the texture that V is written to.
    ///
    /// # Errors
    /// A `map_size` that the device has no texture of; what the source's GPU path objects to.
    pub fn new(
        device: &wgpu::Device,
        technique: &ContactHardening,
        visibility: wgpu::TextureFormat,
    ) -> Result<Self, TechniqueError> {
        let params = technique.params;
        GpuError::within(
            "texels a side of a map",
            params.map_size,
            device.limits().max_texture_dimension_2d,
        )?;
        let source = match technique.source() {
            Some(source) => {
                let technique = source.gpu(device, ONE)?;
                Some(SourceOnGpu { technique, image: Image::new("V of the source", ONE) })
            }
            None => None,
        };
        let map = ShadowMapParams {
            variant: MapVariant::Pcf,
            map_size: params.map_size,
            skip: params.skip,
            ..Default::default()
        };
        let fragment = wgpu::ShaderStages::FRAGMENT;
        let types = [
            binding::UNIFORM,
            binding::STORAGE,
            binding::ID_LAYERS,
            binding::STORAGE,
            binding::STORAGE,
            binding::FLOATS,
            binding::STORAGE,
            binding::FLOATS,
            binding::FLOATS,
            binding::UNIFORM,
            binding::STORAGE,
        ];
        let own = HeldGroup::new(device, "contact hardening", fragment, &types);
        let scene = SceneBindings::new(device, fragment | wgpu::ShaderStages::COMPUTE);
        let receivers = Receivers::new(device);
        let mut passes: Vec<Pass> = Vec::new();
        for step in steps(&params) {
            let parts = VisibilityPassParts {
                label: step.entry,
                wgsl: step.wgsl,
                fragment: step.entry,
                own: own.layout(),
                scene: &scene,
                receivers: &receivers,
                format: if step.writes == Slot::Visibility { visibility } else { PAIRS },
            };
            let pipeline = VisibilityPass::new(device, &parts);
            passes.push(Pass { step, pipeline, uniform: HeldBuffer::uniform("pass"), own: own.another() });
        }
        Ok(Self {
            technique: technique.clone(),
            maps: LightMapsOnGpu::new(device, map),
            filter: FilterMapsOnGpu::new(device, params.map_size, &scene.triangles_layout),
            backs: (params.solids && params.scaling == Scaling::Physical)
                .then(|| BacksOnGpu::new(device, params.map_size, &scene.triangles_layout)),
            scene,
            receivers,
            source,
            settings: HeldBuffer::storage("settings"),
            pyramid: PyramidOnGpu::new(device),
            images: Images::new(),
            passes,
            prepared: None,
        })
    }

    /// Pass 1: records the drawing of the map, and the preparation of the source.
    ///
    /// # Errors
    /// More maps or texels than the device has; those of the source.
    pub fn prepare(
        &mut self,
        recorder: &mut Recorder<'_>,
        query: &GpuShadowQuery<'_>,
    ) -> Result<Report, TechniqueError> {
        let mut report = Report::default();
        self.prepared = None;
        let device = recorder.device;
        let plan = report.time("prepare.views", |report| self.maps.plan(&query.scene, query.light, report));
        if let Some(drawn) = self.maps.draw(recorder, &query.scene, &plan, "prepare.maps")? {
            let scene = self.scene.groups(device, &query.scene);
            let depths = self.filter.record(recorder, &drawn, &scene.triangles)?;
            let backs = match &mut self.backs {
                Some(backs) => backs.record(recorder, &query.scene, &plan, &drawn, &scene.triangles)?,
                None => None,
            };
            self.prepared = Some(Prepared {
                // What has no far side is as thin as its near one.
                backs: backs.unwrap_or_else(|| depths.clone()).into(),
                maps: vec![drawn.maps.into(), drawn.views.into(), drawn.ids, depths.into()],
                scene,
                kernel: self.technique.params.kernel_for(query.light),
                fine: self.technique.params.fine_kernel_for(query.light),
                is_parallel: matches!(query.light, Light::Directional { .. }),
            });
        }
        self.receivers.prepare(recorder, query);
        report.bytes = self.bytes();
        if let Some(source) = &mut self.source {
            let rest = source.technique.prepare(recorder, query)?;
            report.merge_beside(&rest);
        }
        Ok(report)
    }

    /// Passes 2 to 5: records those that write V of every pixel, 1 where nothing is seen.
    ///
    /// # Errors
    /// [`TechniqueError::NotPrepared`]; an image whose pyramid is larger than the device binds; those of the source.
    pub fn shade(
        &mut self,
        recorder: &mut Recorder<'_>,
        camera: &Camera,
        gbuffer: &GpuGBuffer<'_>,
        visibility: &wgpu::TextureView,
    ) -> Result<Report, TechniqueError> {
        let not_prepared = || TechniqueError::NotPrepared { technique: ContactHardeningParams::TECHNIQUE };
        let prepared = self.prepared.as_ref().ok_or_else(not_prepared)?;
        let (device, size) = (recorder.device, gbuffer.size);
        let receivers = self.receivers.group(device, camera, gbuffer).ok_or_else(not_prepared)?;
        let mut report = Report::default();
        let source = match &mut self.source {
            Some(SourceOnGpu { technique, image }) => {
                let view = image.get(device, size);
                report.merge(&technique.shade(recorder, camera, gbuffer, &view)?);
                Some(view)
            }
            None => None,
        };
        let settings = SettingsTable::new(
            &self.technique.params,
            &prepared.kernel,
            &prepared.fine,
            prepared.is_parallel,
            source.is_some(),
            size,
        );
        let settings = self.settings.get(device, bytemuck::bytes_of(&settings));
        let tiles = self.pyramid.buffer(device, size)?;
        for Pass { step, pipeline, uniform, own } in &mut self.passes {
            let read = |slot| self.images.get(device, slot, size).unwrap_or_else(|| gbuffer.surface.clone());
            let [first, second, third] = step.reads.map(read);
            if step.after_pyramid {
                self.pyramid.record(recorder, &first, size)?;
            }
            let second = match &source {
                Some(source) if step.writes == Slot::Distance => source.clone(),
                _ => second,
            };
            let uniform = uniform.get(device, bytemuck::bytes_of(&step.uniform));
            let mut bound = prepared.maps.clone();
            bound.extend([
                settings.clone().into(),
                (&first).into(),
                tiles.clone().into(),
                (&second).into(),
                (&third).into(),
                uniform.into(),
                prepared.backs.clone(),
            ]);
            let own = own.get(device, &bound);
            let target = self.images.get(device, step.writes, size).unwrap_or_else(|| visibility.clone());
            pipeline.record(recorder, step.stage, &own, &prepared.scene, &receivers, &target);
        }
        report.bytes += self.bytes();
        Ok(report)
    }

    /// The map, a layer a view, and the triangles it sees; for tests and whoever else wants them.
    pub fn layers(&self) -> &DepthLayers {
        self.maps.layers()
    }

    /// Where look-ups read depths from: the buffer, and how many numbers it holds a view, those of the map first.
    pub fn depths(&self) -> Option<(&wgpu::Buffer, u32)> {
        self.filter.depths()
    }

    fn bytes(&self) -> u64 {
        let source = self.source.as_ref().map_or(0, |source| source.image.bytes());
        let backs = self.backs.as_ref().map_or(0, BacksOnGpu::bytes);
        backs
            + self.maps.layers().bytes()
            + self.filter.bytes()
            + self.pyramid.bytes()
            + self.images.bytes()
            + source
    }

    /// Whether the preparation holds for any camera.
    pub fn survives_camera(&self) -> bool {
        self.source.as_ref().is_none_or(|source| source.technique.survives_camera())
    }
}
