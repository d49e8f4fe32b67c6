//! What each map of a light has to hold for the surfaces that a camera sees, by variant.

use std::cell::OnceCell;

use scene_core::relevance::{self, Backdrops, CasterChunks, CasterRegion, Receivers, RelevantCasters};
use scene_core::{Light, Scene};

use crate::cone_reach;
use crate::light_views::LightView;
use crate::params::{HARD_REACH, ShadowMapParams, Variant};
use crate::view_casters::{self, ViewNeeds};

/// How far from a receiver's own texel lookups go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// That many texels at most.
    Texels(f64),
    /// As far as there can be anything between the receiver and a light of some extent.
    Cone,
}

impl Reach {
    /// Of one lookup. `None` where the variant has none.
    pub(crate) fn of_lookup(params: &ShadowMapParams, light: &Light) -> Option<Self> {
        match params.variant {
            Variant::Pcss if light.is_extended() => Some(Self::Cone),
            // The cone to a light of no extent is a line.
            Variant::Hard | Variant::Pcss | Variant::Cascaded | Variant::MultiView => {
                Some(Self::Texels(HARD_REACH))
            }
            Variant::Pcf | Variant::ObjectId | Variant::Moments => {
                Some(Self::Texels(f64::from(params.filter) * 0.5 + 2.0))
            }
            Variant::AliasFree => None,
        }
    }

    /// What prepared maps are looked up in. `None` for variants that choose what they draw while they shade, too.
    pub(crate) fn of(params: &ShadowMapParams, light: &Light) -> Option<Self> {
        let draws_while_shading = matches!(params.variant, Variant::Cascaded | Variant::MultiView);
        Self::of_lookup(params, light).filter(|_| !draws_while_shading)
    }
}

/// Who sees, by what light.
#[derive(Debug)]
pub(crate) struct Seen<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) light: &'s Light,
    pub(crate) receivers: Receivers,
    pub(crate) casters: &'s Backdrops<'s>,
    pub(crate) chunks: &'s CasterChunks,
    pub(crate) map_size: u32,
    /// [`cone_reach::sine_beside`], found when it is first asked for.
    pub(crate) sine: OnceCell<Option<f64>>,
}

impl Seen<'_> {
    /// What `view`, one of several if `is_face`, has to hold. `None` if no bound is known.
    pub(crate) fn needs(&self, view: &LightView, is_face: bool, reach: Reach) -> Option<ViewNeeds> {
        match reach {
            Reach::Texels(reach) => self.needs_of_texels(view, is_face, reach),
            Reach::Cone if is_face => self.needs_of_face(view),
            Reach::Cone => {
                let window = cone_reach::read_texels(view, self.light, &self.receivers, self.map_size)?;
                let sides = view.sides_of(&window, self.map_size);
                let casters = self.casters_in(&CasterRegion::inside(self.scene, &sides));
                Some(ViewNeeds { casters, window })
            }
        }
    }

    fn needs_of_texels(&self, view: &LightView, is_face: bool, reach: f64) -> Option<ViewNeeds> {
        let (scene, light, map_size) = (self.scene, self.light, self.map_size);
        let seen = if is_face {
            let sides = view_casters::looked_up_in(view, map_size, reach)?;
            self.receivers.clone().inside(&sides)
        } else {
            self.receivers.clone()
        };
        let region = view_casters::looked_up_behind(scene, light, &seen, &[*view], map_size, reach);
        let casters = self.casters_in(&region);
        // A filter that goes on into this face from that beside it is there by up to its reach more to the side.
        let reach = if is_face { 3.0 * reach } else { reach };
        let window = view_casters::looked_up_texels(view, &seen, map_size, reach);
        Some(ViewNeeds { casters, window })
    }

    /// All of a face, or nothing.
    fn needs_of_face(&self, view: &LightView) -> Option<ViewNeeds> {
        let (scene, light, map_size) = (self.scene, self.light, self.map_size);
        let find_sine = || cone_reach::sine_beside(scene, light, &self.receivers, map_size);
        let sine = (*self.sine.get_or_init(find_sine))?;
        let seen = self.receivers.clone().inside(&cone_reach::looked_up_in(view, sine, map_size)?);
        let region = if seen.is_empty() {
            CasterRegion::along(scene, &seen, light.center())
        } else {
            CasterRegion::inside(scene, &view.sides(1.0, 0.0))
        };
        let end = if seen.is_empty() { 0 } else { map_size };
        Some(ViewNeeds { casters: self.casters_in(&region), window: [0..end, 0..end] })
    }

    fn casters_in(&self, region: &CasterRegion) -> RelevantCasters {
        relevance::relevant_casters(self.scene, region, self.chunks, |id| {
            let object = &self.scene.objects()[id as usize];
            !self.casters.backdrops.iter().any(|backdrop| std::ptr::eq(*backdrop, object))
        })
    }
}
