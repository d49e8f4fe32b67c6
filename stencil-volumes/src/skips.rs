//! What work is left out because it cannot change the image.

/// Which work is left out. [`VolumeParams::skip`](crate::VolumeParams::skip) turns all of it on or off; one by one it is for
/// measuring. No image changes with any of it.
///
/// With all of it off every caster is extruded, counted from infinity with its caps, and asked of every block of the image,
/// for every seen pixel of a receiver. What stays is the algorithm itself: a tile that no side crosses takes one count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips {
    /// Casters outside of H, the region that can shadow what is seen ([`scene_core::relevance::CasterRegion`]).
    pub outside: bool,
    /// Casters wholly inside another's shadow: what they hide, it hides, too.
    pub shadowed: bool,
    /// A caster's edges are asked in runs of [`RUN`](crate::runs::RUN): a run is left out of a block of pixels where its rectangle
    /// on the screen or its depth (the bounds that a scissor and a depth-bounds test would hold) or its place beside what lies
    /// between the block and the light says that none of its edges matters there.
    pub bounded: bool,
    /// Seen pixels that the light cannot reach, being behind their surface or outside of its cone: V is 0 without a count.
    pub unlit: bool,
    /// Caps of casters that are proved to be right by z-pass, of [`Count::Auto`](crate::Count::Auto); the others are counted
    /// from infinity. On the GPU no caps are counted at all.
    pub caps: bool,
}

impl Skips {
    /// Everything that does not matter is left out.
    pub const ALL: Self = Self { outside: true, shadowed: true, bounded: true, unlit: true, caps: true };
    /// Nothing is.
    pub const NONE: Self =
        Self { outside: false, shadowed: false, bounded: false, unlit: false, caps: false };

    /// All or none.
    pub const fn new(all: bool) -> Self {
        if all { Self::ALL } else { Self::NONE }
    }

    /// None, each alone and all, with their names.
    pub const EACH: [(&'static str, Self); 7] = [
        ("none", Self::NONE),
        ("casters outside H", Self { outside: true, ..Self::NONE }),
        ("casters in another's shadow", Self { shadowed: true, ..Self::NONE }),
        ("bounds per caster", Self { bounded: true, ..Self::NONE }),
        ("receivers no light reaches", Self { unlit: true, ..Self::NONE }),
        ("caps z-pass does not need", Self { caps: true, ..Self::NONE }),
        ("all", Self::ALL),
    ];
}
