//! Functions kept in a file: index and data arrays as they lie in memory and on the GPU (figure 6), behind a header with a
//! version and a checksum.
//!
//! All is 32-bit words, little-endian. Words 0 and 1 are `GnomPDSM`, 2 the version, 3 the CRC-32 of all other bytes, 4 and
//! 5 the number of words in the file. Settings and light follow, then for each window its axes and extent, the light's
//! samples, n² + 1 entries of the index and the nodes.
//!
//! A file is read in one piece and copied to where it is used: mapping it into memory cannot be done without `unsafe`,
//! which this workspace forbids. What is cut short or altered is refused: CRC-32 finds every change of up to 32 bits in a
//! row, and another one but for a chance of 2⁻³². A file made to deceive is not trusted either: every number is held
//! within what lookups may meet, so that it can make wrong shadows, but no panic.

mod record;
mod words;

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use gnomon_shadow_map::receiver_plane::plane_tolerance;
use scene_core::geometry::Object;
use scene_core::io::write::{self, WriteError};
use scene_core::technique::TechniqueError;
use scene_core::{Light, Origin, Report, Scene};
use thiserror::Error;

use crate::cpu::Window;
use crate::{Pdsm, PdsmParams, PreparedPdsm};
use words::{Reader, Writer};

/// The first eight bytes.
const MAGIC: &[u8; 8] = b"GnomPDSM";
/// The format of this build.
pub const VERSION: u32 = 1;
/// Words of the header.
const HEADER: usize = 6;
/// Which of them holds the checksum.
const CHECKSUM: usize = 3;

/// Why a file is not taken.
#[derive(Debug, Error)]
pub enum BakedError {
    /// The system refused.
    #[error("cannot be read")]
    Read(#[from] std::io::Error),
    /// Something else.
    #[error("is not a baked PDSM: it does not begin with GnomPDSM")]
    NotBaked,
    /// Another build's.
    #[error("has format {found}: this build reads format {VERSION}; bake it again")]
    Version {
        /// What it says.
        found: u32,
    },
    /// Its end is missing, or there is more.
    #[error("has {found} bytes, not {expected}: it was cut short or added to; bake it again")]
    Length {
        /// Bytes there are.
        found: u64,
        /// Bytes it says there are.
        expected: u64,
    },
    /// Bytes are not what was written.
    #[error("was altered: its checksum is {found:08x}, not {expected:08x}; bake it again")]
    Altered {
        /// Of what is there.
        found: u32,
        /// Of what was written.
        expected: u32,
    },
    /// The checksum is right, what it is of is not.
    #[error("contradicts itself: it was not written by `gnomon bake`")]
    Inconsistent,
    /// It belongs to another light.
    #[error("was baked for another light")]
    OtherLight,
    /// It belongs to other geometry.
    #[error("was baked for other {what}; only objects that are `dynamic` may be added or moved")]
    OtherScene {
        /// What differs.
        what: &'static str,
    },
    /// Only surfaces of the scene as it was are in it.
    #[error("holds the surfaces of a scene that stands still, and object '{object}' is dynamic")]
    DynamicReceiver {
        /// The object.
        object: String,
    },
}

/// What a file knows its scene by: CRC-32 of vertices and triangles of what is not dynamic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Fingerprint {
    casters: u32,
    all: u32,
}

impl Fingerprint {
    fn new(scene: &Scene) -> Self {
        let hash = |counts: fn(&Object) -> bool| {
            let mut crc = crc32fast::Hasher::new();
            for object in scene.objects().iter().filter(|o| !o.flags.dynamic && counts(o)) {
                let first = object.vertices.start as u32;
                // Objects before it may have come or gone.
                let triangles: Vec<[u32; 3]> = scene.triangles()[object.triangles.clone()]
                    .iter()
                    .map(|triangle| triangle.map(|vertex| (vertex - first).to_le()))
                    .collect();
                crc.update(&[u8::from(object.flags.receives), u8::from(object.alpha.is_some())]);
                crc.update(bytemuck::cast_slice(&scene.positions()[object.vertices.clone()]));
                crc.update(bytemuck::cast_slice(&triangles));
            }
            crc.finalize()
        };
        Self { casters: hash(|object| object.flags.casts), all: hash(|_| true) }
    }
}

/// The functions of one light in a scene, without the scene: what a file holds. Casters that are dynamic are no part of
/// it.
#[derive(Clone, Debug)]
pub struct Baked {
    params: PdsmParams,
    light: Light,
    tolerance: f32,
    fingerprint: Fingerprint,
    windows: Arc<[Window]>,
}

impl Pdsm {
    /// Builds the PDSM of `light` over the casters that are not dynamic, for any camera: without `cascades`.
    pub fn bake(&self, scene: &Scene, light: &Light) -> (Baked, Report) {
        let mut report = Report::default();
        let any_camera = self.for_any_camera();
        let (windows, tolerance) =
            any_camera.windows(scene, light, None, |object| !object.flags.dynamic, &mut report);
        let fingerprint = Fingerprint::new(scene);
        (Baked { params: any_camera.params, light: *light, tolerance, fingerprint, windows }, report)
    }
}

impl Baked {
    /// Settings it was built with.
    pub fn params(&self) -> &PdsmParams {
        &self.params
    }

    /// Its light.
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// Whether nothing that stands still is before anything else: no function is in it.
    pub fn is_empty(&self) -> bool {
        self.windows.iter().all(|window| window.functions.nodes().is_empty())
    }

    /// The functions, to shade `scene` with. Its dynamic casters get a PDSM of their own, made here, so that a frame in
    /// which they moved costs no more than they do.
    ///
    /// # Errors
    /// Another light or other geometry than it was baked for.
    pub fn prepare<'a>(
        &self,
        scene: &'a Scene,
        light: &Light,
    ) -> Result<(PreparedPdsm<'a>, Report), BakedError> {
        if *light != self.light {
            return Err(BakedError::OtherLight);
        }
        let fingerprint = Fingerprint::new(scene);
        if fingerprint.casters != self.fingerprint.casters {
            return Err(BakedError::OtherScene { what: "casters" });
        }
        if self.params.only_surfaces {
            if let Some(object) = scene.objects().iter().find(|object| object.flags.dynamic) {
                return Err(BakedError::DynamicReceiver { object: object.name.clone() });
            }
            if fingerprint.all != self.fingerprint.all {
                return Err(BakedError::OtherScene { what: "receivers" });
            }
        }
        let mut report = Report::default();
        let mut prepared = PreparedPdsm {
            // What is kept must not hang on where dynamic objects are now.
            origin: Origin::WORLD,
            scene: Cow::Borrowed(scene),
            light: *light,
            windows: Arc::clone(&self.windows),
            moving: Arc::default(),
            tolerance: self.tolerance.max(plane_tolerance(scene.bounds(), light)),
            params: self.params,
        };
        report.bytes = prepared.bytes();
        report.merge(&prepared.update_moving());
        Ok((prepared, report))
    }

    /// The file's bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = Writer::default();
        writer.words.extend_from_slice(&[0; HEADER]);
        record::write(self, &mut writer);
        let mut words = writer.words;
        let [a, b, c, d, e, f, g, h] = *MAGIC;
        let length = words.len() as u64;
        words[..HEADER].copy_from_slice(&[
            u32::from_le_bytes([a, b, c, d]),
            u32::from_le_bytes([e, f, g, h]),
            VERSION,
            0,
            length as u32,
            (length >> 32) as u32,
        ]);
        words.iter_mut().for_each(|word| *word = word.to_le());
        words[CHECKSUM] = checksum(&words).to_le();
        bytemuck::cast_slice(&words).to_vec()
    }

    /// From a file's bytes.
    ///
    /// # Errors
    /// Bytes that [`to_bytes`](Self::to_bytes) did not make.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakedError> {
        if !bytes.starts_with(MAGIC) {
            return Err(BakedError::NotBaked);
        }
        let found = bytes.len() as u64;
        let whole = bytes.len() / 4 * 4;
        let mut words: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes[..whole]);
        if words.len() < HEADER {
            return Err(BakedError::Length { found, expected: 4 * HEADER as u64 });
        }
        let sum = checksum(&words);
        words.iter_mut().for_each(|word| *word = u32::from_le(*word));
        if words[2] != VERSION {
            return Err(BakedError::Version { found: words[2] });
        }
        let expected = (u64::from(words[4]) | u64::from(words[5]) << 32).saturating_mul(4);
        if found != expected {
            return Err(BakedError::Length { found, expected });
        }
        if sum != words[CHECKSUM] {
            return Err(BakedError::Altered { found: sum, expected: words[CHECKSUM] });
        }
        record::read(&mut Reader { words: &words[HEADER..] }).ok_or(BakedError::Inconsistent)
    }

    /// Reads a file, in one piece.
    ///
    /// # Errors
    /// What cannot be read, and what is no such file as it was written.
    pub fn read(path: &Path) -> Result<Self, BakedError> {
        Self::from_bytes(&std::fs::read(path)?)
    }

    /// Writes a file: under another name, which is changed when all is there.
    ///
    /// # Errors
    /// What the system refuses; a file that was there is untouched then.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write::bytes(path, &self.to_bytes())
    }
}

/// For the trait.
pub(crate) fn refused(error: BakedError) -> TechniqueError {
    TechniqueError::Other(Box::new(error))
}

/// CRC-32 of little-endian words but that of the checksum.
fn checksum(words: &[u32]) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    crc.update(bytemuck::cast_slice(&words[..CHECKSUM]));
    crc.update(bytemuck::cast_slice(&words[CHECKSUM + 1..]));
    crc.finalize()
}
