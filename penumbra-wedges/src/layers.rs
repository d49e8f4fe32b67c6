//! How many layers lie between a receiver and the light's middle: where sums over edges start.

use scene_core::bvh::Bvh;
use scene_core::light::LightPoint;

use crate::receiver::Receiver;

/// Layers counted before one gives up: a sum that starts so far below 0 stays there.
const MOST: i32 = 64;

/// The number of faces with a facing that a shadow ray to `middle` meets, by one closest hit after the other. `rays` is
/// how many it took.
pub fn layers_before(
    tree: &Bvh,
    facing: &[i8],
    receiver: &Receiver,
    middle: LightPoint,
    rays: &mut u64,
) -> i32 {
    *rays += 1;
    if !tree.is_occluded(receiver.origin, middle) {
        return 0;
    }
    let (direction, end) = middle.ray_from(receiver.origin);
    let (mut from, mut layers) = (0.0_f32, 0);
    while layers < MOST {
        *rays += 1;
        let Some(hit) = tree.closest_hit(receiver.origin, direction, from, end) else { break };
        layers += i32::from(facing[hit.triangle as usize] != 0);
        from = hit.t.next_up();
    }
    layers
}
