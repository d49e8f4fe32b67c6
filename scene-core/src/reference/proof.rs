//! Pixels whose V is proved to be 0 or 1 for every sample there could be, so that none need be traced.

use glam::Vec3;

use super::outline::LightOutline;
use crate::Light;
use crate::bvh::{Bvh, Cover, LastCover, shadow_origin};

/// A pixel's surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Receiver {
    pub(super) position: Vec3,
    pub(super) normal: Vec3,
    /// Largest coordinate of the scene.
    pub(super) magnitude: f32,
}

/// What holds for every sample of the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Proof {
    /// Above the tangent plane and not blocked: V = 1.
    Lit,
    /// Below the tangent plane or blocked: V = 0.
    Dark,
}

/// Tries to settle a pixel by one walk of the tree. Lights without extent take one ray and are left to it.
pub(super) fn prove(tree: &Bvh, light: &Light, receiver: Receiver, last: &mut LastCover) -> Option<Proof> {
    let Receiver { position, normal, magnitude } = receiver;
    let origin = shadow_origin(position, normal, magnitude);
    let outline = LightOutline::new(light, origin, magnitude)?;
    let (lowest, highest, margin) = outline.heights(position, normal);
    if highest < -margin {
        return Some(Proof::Dark);
    }
    match tree.cover(origin, outline.points(), last) {
        Cover::Clear if lowest > margin => Some(Proof::Lit),
        Cover::Covered => Some(Proof::Dark),
        Cover::Clear | Cover::Unknown => None,
    }
}
