//! Marching squares: the outline of a set of texels in one square of four texel centres.
//!
//! Corners are numbered as the image shows them: top left, top right, bottom right, bottom left; side i runs from corner i
//! to the next. The light sees the image as it is shown, with y up: counter-clockwise is from corner 3 to 2 to 1 to 0.

use glam::Vec2;

/// The segments between the crossings of a square's sides, each with the set on its left as the image shows it. Two
/// opposite corners are cut off one by one: the set does not reach through.
pub fn outlines(
    inside: [bool; 4],
    mut crossing: impl FnMut(usize) -> Vec2,
) -> impl Iterator<Item = [Vec2; 2]> {
    let mut found = [None; 2];
    // A segment begins where the set is left and ends where it is entered again, walking clockwise from corner to corner.
    // Beyond a corner i outside the square between two sides, the set lies left of the way from the side where the walk
    // leaves the set to the side where it enters.
    let leaves = |side: usize| inside[side] && !inside[(side + 1) % 4];
    let enters = |side: usize| !inside[side] && inside[(side + 1) % 4];
    for (found, side) in found.iter_mut().zip((0..4).filter(|&side| enters(side))) {
        // The corner entered and those after it, up to where the walk leaves.
        let mut end = (side + 1) % 4;
        while !leaves(end) {
            end = (end + 1) % 4;
        }
        // The way from where the walk leaves back to where it entered closes the part of the set clockwise, so the other way
        // round has it on the left, y up: see the test.
        *found = Some([crossing(side), crossing(end)]);
    }
    found.into_iter().flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIDDLES: [Vec2; 4] =
        [Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5), Vec2::new(0.5, 1.0), Vec2::new(0.0, 0.5)];
    const CORNERS: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];

    #[test]
    fn the_set_lies_left_of_its_outline() {
        for bits in 0..16 {
            let inside = [0, 1, 2, 3].map(|i| bits >> i & 1 == 1);
            let segments: Vec<_> = outlines(inside, |side| MIDDLES[side]).collect();
            let changes = (0..4).filter(|&i| inside[i] != inside[(i + 1) % 4]).count();
            assert_eq!(segments.len() * 2, changes);
            for [a, b] in segments {
                // Corners next to the segment's ends, on its left with y up: y runs down here.
                let left = |p: Vec2| (b - a).perp_dot(p - a) < 0.0;
                for end in [a, b] {
                    for (corner, &is_inside) in CORNERS.iter().zip(&inside) {
                        if corner.distance(end) < 0.6 {
                            assert_eq!(left(*corner), is_inside, "{bits:04b} {a} {b} {corner}");
                        }
                    }
                }
            }
        }
    }
}
