//! Which passes the settings ask for after pass 2, in their order.

use crate::params::{ContactHardeningParams, GaussianKernel, Scaling, Show, Variant};

use super::layout::PassUniform;
use super::shaders;

/// Images that passes read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    /// The G-buffer's normals and depths: what a pass that has no image to read is given, since none is bound before it is
    /// written.
    Surface,
    /// S and D of pass 2.
    Distance,
    /// The first of two that blurs go to and fro between.
    A,
    /// The other.
    B,
    /// How many passes a pixel takes; or S and D before a pass, while its rows are blurred.
    Plan,
    /// The caller's.
    Visibility,
}

/// A full-screen pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Step {
    /// Its time is booked as this.
    pub(super) stage: &'static str,
    /// The entry point, and the module it is in.
    pub(super) entry: &'static str,
    /// Linked WGSL.
    pub(super) wgsl: &'static str,
    /// Bound as `distance_map`, and as the images of the pass's own.
    pub(super) reads: [Slot; 3],
    /// What is written.
    pub(super) writes: Slot,
    /// What tells it from others with the same entry point.
    pub(super) uniform: PassUniform,
    /// Whether it follows the making of the pyramid above `reads[0]`.
    pub(super) after_pyramid: bool,
}

fn step(
    stage: &'static str,
    wgsl: &'static str,
    entry: &'static str,
    reads: [Slot; 3],
    writes: Slot,
) -> Step {
    Step { stage, entry, wgsl, reads, writes, uniform: PassUniform::default(), after_pyramid: false }
}

/// The passes of these settings.
pub(super) fn steps(params: &ContactHardeningParams) -> Vec<Step> {
    use Slot::{A, B, Distance, Plan, Surface, Visibility};
    let distance = step("shade.distance", shaders::DISTANCE, "shade_distance", [Surface; 3], Distance);
    let mut steps = vec![distance];
    let finish =
        |entry, from| step("shade.finish", shaders::FINISH, entry, [Distance, from, from], Visibility);
    if params.show == Show::Distance {
        steps.push(Step { after_pyramid: true, ..finish("show_distance", Distance) });
        return steps;
    }
    match (params.scaling, params.variant) {
        (Scaling::Physical, Variant::Pcf | Variant::Gaussian) => {
            let filter = step("shade.filter", shaders::FILTER, "shade_filter", [Distance; 3], A);
            steps.push(Step { after_pyramid: true, ..filter });
            steps.push(Step { stage: "shade.smooth", ..finish("shade_smooth", A) });
        }
        (Scaling::Physical, Variant::MultiPass) => {
            let plan = step("shade.filter", shaders::MULTI_PASS, "plan_passes", [Distance; 3], Plan);
            steps.push(Step { after_pyramid: true, ..plan });
            let mut from = Distance;
            for index in 0..params.passes {
                let to = if from == A { B } else { A };
                let blur = step("shade.filter", shaders::MULTI_PASS, "blur_pass", [Distance, from, Plan], to);
                steps.push(Step { uniform: PassUniform { index, ..Default::default() }, ..blur });
                from = to;
            }
            steps.push(Step { reads: [Distance, from, Plan], ..finish("shade_passes", from) });
        }
        (Scaling::Paper, variant) => {
            let mut from = Distance;
            let mut pass = |stage, entry, uniform, before: Option<Slot>| {
                let is_free = |slot: &Slot| *slot != from && Some(*slot) != before;
                let to = [A, B, Plan].into_iter().find(is_free).unwrap_or(Plan);
                let reads = [Distance, from, before.unwrap_or(from)];
                steps.push(Step { uniform, ..step(stage, shaders::PAPER_PASSES, entry, reads, to) });
                std::mem::replace(&mut from, to)
            };
            if params.dilate > 1 {
                pass("shade.dilate", "dilate_rows", PassUniform::default(), None);
                pass("shade.dilate", "dilate_columns", PassUniform::default(), None);
            }
            let count = if variant == Variant::MultiPass { params.passes } else { 1 };
            for index in 0..count {
                let uniform = match variant {
                    Variant::MultiPass => {
                        PassUniform { index, width: params.pass_size(index), counts_down: 1 }
                    }
                    _ => PassUniform::default(),
                };
                if variant == Variant::Pcf {
                    pass("shade.filter", "blur_box", uniform, None);
                } else if params.kernel == GaussianKernel::PoissonDisk {
                    pass("shade.filter", "blur_points", uniform, None);
                } else {
                    let before = pass("shade.filter", "blur_rows", uniform, None);
                    pass("shade.filter", "blur_columns", uniform, Some(before));
                }
            }
            steps.push(finish("shade_blurred", from));
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_read_what_was_written_before() {
        for variant in Variant::ALL {
            for scaling in [Scaling::Physical, Scaling::Paper] {
                for kernel in [GaussianKernel::PoissonDisk, GaussianKernel::Separable] {
                    for show in [Show::Visibility, Show::Distance] {
                        let params = ContactHardeningParams {
                            variant,
                            scaling,
                            kernel,
                            show,
                            dilate: 9,
                            ..Default::default()
                        };
                        let steps = steps(&params);
                        let mut written = Vec::new();
                        for step in &steps {
                            assert!(!step.reads.contains(&step.writes), "{step:?}");
                            let is_written = |slot: &Slot| *slot == Slot::Surface || written.contains(slot);
                            assert!(step.reads.iter().all(is_written), "{step:?}");
                            written.push(step.writes);
                        }
                        assert_eq!(steps.last().map(|step| step.writes), Some(Slot::Visibility));
                    }
                }
            }
        }
    }
}
