//! Cut-outs: materials with `alphaMode: MASK`.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine2, Vec2};
use gltf::json;
use json::material::AlphaMode;
use json::texture::WrappingMode;
use json::validation::Checked;

use super::document::Document;
use crate::geometry::{AlphaMask, Wrap};
use crate::io::LoadError;
use crate::io::texture::{Channel, Texture};

/// What a material leaves of a surface.
#[derive(Clone)]
pub(super) enum Cutout {
    /// All of it.
    Solid,
    /// Nothing: its alpha is below the cut-off everywhere.
    Nothing,
    /// What a mask says, by a set of texture coordinates and a transformation of them.
    Mask { mask: Arc<AlphaMask>, set: u32, mask_from_uv: Affine2 },
}

/// Cut-outs by the index of their material, read once.
#[derive(Default)]
pub(super) struct Cutouts {
    read: HashMap<usize, Cutout>,
    /// Whether a material blends, which is taken for solid.
    pub(super) blended: bool,
}

impl Cutouts {
    /// The cut-out of a material that `from` refers to.
    pub(super) fn get(
        &mut self,
        document: &Document<'_>,
        index: json::Index<json::Material>,
        from: &str,
    ) -> Result<Cutout, LoadError> {
        if let Some(cutout) = self.read.get(&index.value()) {
            return Ok(cutout.clone());
        }
        let material = document.get(&document.root.materials, index, "materials", from)?;
        let name = format!("materials[{}]", index.value());
        let cutout = match material.alpha_mode {
            Checked::Valid(AlphaMode::Opaque) => Cutout::Solid,
            Checked::Valid(AlphaMode::Blend) => {
                self.blended = true;
                Cutout::Solid
            }
            Checked::Valid(AlphaMode::Mask) => read(document, material, &name)?,
            Checked::Invalid => {
                return Err(document.fault(name, "alphaMode is none of OPAQUE, MASK and BLEND"));
            }
        };
        self.read.insert(index.value(), cutout.clone());
        Ok(cutout)
    }
}

fn read(document: &Document<'_>, material: &json::Material, name: &str) -> Result<Cutout, LoadError> {
    let cutoff = material.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0);
    let surface = &material.pbr_metallic_roughness;
    let factor = surface.base_color_factor.0[3];
    let Some(info) = &surface.base_color_texture else {
        return Ok(if factor >= cutoff { Cutout::Solid } else { Cutout::Nothing });
    };
    let root = &document.root;
    let texture =
        document.get(&root.textures, info.index, "textures", &format!("{name}.baseColorTexture"))?;
    let texture_name = format!("textures[{}]", info.index.value());
    let wrap = match texture.sampler {
        None => [Wrap::Repeat; 2],
        Some(index) => {
            let sampler = document.get(&root.samplers, index, "samplers", &texture_name)?;
            let element = format!("samplers[{}]", index.value());
            [wrap(document, sampler.wrap_s, &element)?, wrap(document, sampler.wrap_t, &element)?]
        }
    };
    let image = document.get(&root.images, texture.source, "images", &texture_name)?;
    let image_name = format!("images[{}]", texture.source.value());
    let picture = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => document.resolve(uri, &format!("{image_name}.uri"))?,
        (None, Some(view)) => {
            document.get(&root.buffer_views, view, "bufferViews", &image_name)?;
            document.view(view.value())?.to_vec()
        }
        (None, None) => return Err(document.fault(image_name, "has neither a uri nor a bufferView")),
    };
    let picture = Texture::decode(&picture, Channel::Alpha, document.limits)
        .map_err(|message| document.fault(image_name, message))?;
    let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
    let set = transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord);
    let mask_from_uv = transform.map_or(Affine2::IDENTITY, |t| {
        // The extension turns clockwise in a system with v downwards.
        let (scale, offset) = (Vec2::from_array(t.scale.0), Vec2::from_array(t.offset.0));
        Affine2::from_scale_angle_translation(Vec2::ONE, -t.rotation.0, offset) * Affine2::from_scale(scale)
    });
    Ok(match picture.mask(factor, cutoff, wrap) {
        Some(mask) if !mask.texels().contains(&true) => Cutout::Nothing,
        Some(mask) => Cutout::Mask { mask: Arc::new(mask), set, mask_from_uv },
        None => Cutout::Solid,
    })
}

fn wrap(document: &Document<'_>, mode: Checked<WrappingMode>, element: &str) -> Result<Wrap, LoadError> {
    match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Invalid => Err(document.fault(element, "a wrap mode is none of 33071, 33648 and 10497")),
    }
}
