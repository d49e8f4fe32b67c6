//! What a technique can answer for, told per input.

use serde::Serialize;

use crate::light::Light;

/// How well an input is served.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// Up to sampling and the resolution of the settings.
    Exact,
    /// With a model error that no setting removes; the text says which.
    Approximate(&'static str),
    /// Not at all; the text says why.
    Unsupported(&'static str),
}

impl Support {
    /// Whether an answer is given at all.
    pub fn is_supported(&self) -> bool {
        !matches!(self, Self::Unsupported(_))
    }
}

/// An input that techniques treat differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Capability {
    /// Directional light without extent.
    DirectionalLight,
    /// Directional light with an angular radius.
    Sun,
    /// Point light.
    PointLight,
    /// Spot light.
    SpotLight,
    /// Spherical light.
    SphereLight,
    /// Rectangular light.
    RectLight,
    /// Disk light.
    DiskLight,
    /// Casters with cut-out masks.
    AlphaMask,
    /// Open, non-manifold or inconsistently wound meshes.
    TriangleSoup,
    /// Queries at free points of space.
    FreePoints,
    /// Shading on the GPU.
    Gpu,
}

impl Capability {
    /// Every capability, in the order of the tables.
    pub const ALL: [Self; 11] = [
        Self::DirectionalLight,
        Self::Sun,
        Self::PointLight,
        Self::SpotLight,
        Self::SphereLight,
        Self::RectLight,
        Self::DiskLight,
        Self::AlphaMask,
        Self::TriangleSoup,
        Self::FreePoints,
        Self::Gpu,
    ];

    /// The capability a light asks for.
    pub fn of_light(light: &Light) -> Self {
        match light {
            Light::Directional { .. } if light.is_extended() => Self::Sun,
            Light::Directional { .. } => Self::DirectionalLight,
            Light::Point { .. } => Self::PointLight,
            Light::Spot { .. } => Self::SpotLight,
            Light::Sphere { .. } => Self::SphereLight,
            Light::Rect { .. } => Self::RectLight,
            Light::Disk { .. } => Self::DiskLight,
        }
    }
}

/// What a technique takes, with its present settings.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Description {
    /// One line: what it is.
    pub summary: &'static str,
    /// An entry for each capability.
    pub support: Vec<(Capability, Support)>,
}

impl Description {
    /// What `support` says of every capability.
    pub fn new(summary: &'static str, support: impl Fn(Capability) -> Support) -> Self {
        Self {
            summary,
            support: Capability::ALL.map(|capability| (capability, support(capability))).to_vec(),
        }
    }

    /// How `capability` is served; one that is not listed is unsupported.
    pub fn support(&self, capability: Capability) -> Support {
        self.support
            .iter()
            .find(|(listed, _)| *listed == capability)
            .map_or(Support::Unsupported("not implemented"), |(_, support)| *support)
    }
}
