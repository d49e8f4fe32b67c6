//! The fields of a scene file, as serde reads them.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};

/// A whole scene file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub(super) name: Option<String>,
    pub(super) meshes: Vec<MeshEntry>,
    pub(super) camera: Option<CameraEntry>,
    pub(super) light: Option<LightEntry>,
    #[serde(default)]
    pub(super) lights: Vec<LightEntry>,
    pub(super) planar_receivers: Option<Vec<String>>,
}

/// A mesh: its path, or a table.
#[derive(Debug)]
pub(super) struct MeshEntry(pub(super) MeshTable);

/// A mesh file and its place.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshTable {
    pub(super) file: String,
    pub(super) translate: Option<[f32; 3]>,
    pub(super) rotate: Option<Vec<f32>>,
    pub(super) scale: Option<Scale>,
    pub(super) casts: Option<bool>,
    pub(super) receives: Option<bool>,
    pub(super) dynamic: Option<bool>,
    pub(super) points: Option<bool>,
}

impl<'de> Deserialize<'de> for MeshEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PathOrTable;
        impl<'de> Visitor<'de> for PathOrTable {
            type Value = MeshEntry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a path, or a table with the field `file`")
            }

            fn visit_str<E: de::Error>(self, path: &str) -> Result<MeshEntry, E> {
                Ok(MeshEntry(MeshTable { file: path.to_owned(), ..Default::default() }))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<MeshEntry, A::Error> {
                MeshTable::deserialize(MapAccessDeserializer::new(map)).map(MeshEntry)
            }
        }
        deserializer.deserialize_any(PathOrTable)
    }
}

/// One factor for all axes, or one each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale(pub(super) [f32; 3]);

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrThree;
        impl<'de> Visitor<'de> for OneOrThree {
            type Value = Scale;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number or three numbers")
            }

            fn visit_f64<E: de::Error>(self, factor: f64) -> Result<Scale, E> {
                Ok(Scale([factor as f32; 3]))
            }

            fn visit_i64<E: de::Error>(self, factor: i64) -> Result<Scale, E> {
                Ok(Scale([factor as f32; 3]))
            }

            fn visit_u64<E: de::Error>(self, factor: u64) -> Result<Scale, E> {
                Ok(Scale([factor as f32; 3]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Scale, A::Error> {
                let mut factors = [0.0; 3];
                for (i, factor) in factors.iter_mut().enumerate() {
                    *factor = seq.next_element()?.ok_or_else(|| de::Error::invalid_length(i, &self))?;
                }
                match seq.next_element::<f32>()? {
                    Some(_) => Err(de::Error::invalid_length(4, &self)),
                    None => Ok(Scale(factors)),
                }
            }
        }
        deserializer.deserialize_any(OneOrThree)
    }
}

/// A camera; what is missing is chosen.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraEntry {
    pub(super) eye: Option<[f32; 3]>,
    pub(super) target: Option<[f32; 3]>,
    pub(super) up: Option<[f32; 3]>,
    pub(super) fov_y_deg: Option<f32>,
    pub(super) near: Option<f32>,
    pub(super) far: Option<f32>,
    pub(super) width: Option<u32>,
    pub(super) height: Option<u32>,
}

/// A light of any kind: which fields it needs depends on `kind`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LightEntry {
    pub(super) kind: String,
    pub(super) center: Option<[f32; 3]>,
    pub(super) half_u: Option<[f32; 3]>,
    pub(super) half_v: Option<[f32; 3]>,
    pub(super) normal: Option<[f32; 3]>,
    pub(super) radius: Option<f32>,
    pub(super) direction: Option<[f32; 3]>,
    pub(super) angular_radius_deg: Option<f32>,
    pub(super) position: Option<[f32; 3]>,
    pub(super) outer_deg: Option<f32>,
    pub(super) inner_deg: Option<f32>,
}
