//! The pipelines.

use scene_core::gpu::{
    ComputePass, HeldGroup, HeldGroups, Receivers, SceneBindings, VisibilityPass, VisibilityPassParts,
    binding,
};

use super::shaders;
use crate::params::Variant;

/// A compute pass with its group 0.
#[derive(Debug)]
pub(super) struct Pass {
    pub(super) pass: ComputePass,
    pub(super) group: HeldGroup,
}

/// A compute pass with a group 0 for each piece of the table that it takes.
#[derive(Debug)]
pub(super) struct PiecewisePass {
    pub(super) pass: ComputePass,
    pub(super) groups: HeldGroups,
}

/// All of a variant's.
#[derive(Debug)]
pub(super) struct Passes {
    pub(super) find_facing: Pass,
    pub(super) extract: PiecewisePass,
    /// Of `interpolated`.
    pub(super) find_sides: Option<Pass>,
    pub(super) list_edges: Pass,
    /// Of `exact`.
    pub(super) find_masked: Option<Pass>,
    pub(super) count: Pass,
    /// Of `exact`.
    pub(super) count_asked: Option<Pass>,
    pub(super) ask: Pass,
    pub(super) trace: Pass,
    pub(super) write_group: HeldGroup,
    pub(super) write: VisibilityPass,
}

/// Which of groups 1 to 3 a pass binds.
#[derive(Clone, Copy)]
enum Binds {
    Nothing,
    Positions,
    Triangles,
    TrianglesAndReceivers,
    All,
}

impl Passes {
    pub(super) fn new(
        device: &wgpu::Device,
        variant: Variant,
        scene: &SceneBindings,
        receivers: &Receivers,
        visibility: wgpu::TextureFormat,
    ) -> Self {
        const READ: wgpu::BindingType = binding::STORAGE;
        const WRITE: wgpu::BindingType = binding::STORAGE_WRITE;
        let stages = wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE;
        let group = |label, types: &[wgpu::BindingType]| {
            HeldGroup::new(device, label, stages, &[&[binding::UNIFORM], types].concat())
        };
        let compute = |label, wgsl, entry, binds, own: &HeldGroup| {
            let (triangles, cutouts) = (Some(&scene.triangles_layout), Some(&scene.cutouts_layout));
            let groups = match binds {
                Binds::Nothing => vec![Some(own.layout())],
                Binds::Positions => vec![Some(own.layout()), Some(&scene.positions_layout)],
                Binds::Triangles => vec![Some(own.layout()), triangles],
                Binds::TrianglesAndReceivers => {
                    vec![Some(own.layout()), triangles, None, Some(receivers.layout())]
                }
                Binds::All => vec![Some(own.layout()), triangles, cutouts, Some(receivers.layout())],
            };
            ComputePass::new(device, label, wgsl, entry, &groups)
        };
        let pass = |label, wgsl, entry, binds, types: &[wgpu::BindingType]| {
            let group = group(label, types);
            Pass { pass: compute(label, wgsl, entry, binds, &group), group }
        };
        let lit = Binds::TrianglesAndReceivers;
        let exact = variant == Variant::Exact;
        let sides = if exact { "find_sides" } else { "find_layers" };
        let trace = pass("wedges traced", shaders::RAYS, "trace", Binds::All, &[READ, READ, WRITE]);
        let ask = if exact {
            pass("wedges rays", shaders::RAYS, "ask", Binds::All, &[READ, READ, WRITE])
        } else {
            pass("wedges layers", shaders::LAYERS, "add_layers", lit, &[READ, READ, READ, WRITE])
        };
        let find_masked =
            exact.then(|| pass("wedges masks", shaders::MASKS, "find_masked", lit, &[READ, READ, WRITE]));
        let count_exact = |label, wgsl| pass(label, wgsl, "count", lit, &[READ, READ, READ, READ, WRITE]);
        let count_asked = exact.then(|| count_exact("wedges asked", shaders::EXACT_ASKED));
        let count = match variant {
            Variant::Exact => count_exact("wedges exact", shaders::EXACT),
            Variant::Coverage => {
                pass("wedges coverage", shaders::COVERAGE, "add", lit, &[READ, READ, READ, WRITE])
            }
            Variant::Interpolated => pass(
                "wedges interpolated",
                shaders::INTERPOLATED,
                "add",
                lit,
                &[READ, READ, READ, READ, WRITE],
            ),
        };
        let extract = [READ, READ, READ, WRITE, WRITE, WRITE];
        let (extract, find_sides, list_edges) = if variant == Variant::Interpolated {
            let (outline, sides) = (shaders::OUTLINE, shaders::SIDES);
            (
                pass("wedges outline", outline, "extract_outline", Binds::Positions, &extract),
                Some(pass(
                    "wedges sides",
                    sides,
                    "find_side_planes",
                    Binds::Nothing,
                    &[READ, READ, READ, READ, WRITE],
                )),
                pass("wedges blocks", shaders::WEDGE_BLOCKS, "list_wedges", lit, &[READ, READ, WRITE, READ]),
            )
        } else {
            (
                pass(
                    "wedges silhouette",
                    shaders::SILHOUETTE,
                    "extract_silhouette",
                    Binds::Positions,
                    &extract,
                ),
                None,
                pass("wedges blocks", shaders::BLOCKS, "list_edges", lit, &[READ, READ, WRITE]),
            )
        };
        let extract = PiecewisePass { pass: extract.pass, groups: HeldGroups::new(extract.group) };
        let write_group = group("wedges write", &[READ]);
        let write = VisibilityPass::new(
            device,
            &VisibilityPassParts {
                label: "wedges write",
                wgsl: shaders::WRITE,
                fragment: "write",
                own: write_group.layout(),
                scene,
                receivers,
                format: visibility,
            },
        );
        Self {
            find_facing: pass(
                "wedges facing",
                shaders::FACING,
                sides,
                Binds::Triangles,
                &[READ, WRITE, WRITE],
            ),
            extract,
            find_sides,
            list_edges,
            find_masked,
            count,
            count_asked,
            ask,
            trace,
            write_group,
            write,
        }
    }
}
