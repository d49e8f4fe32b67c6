//! The two statements of an MTL file that matter to shadows: `newmtl` and `map_d`.
//!
//! `tobj`'s own reader of MTL files panics on statements that are legal (`Kd 0.5`), so it is not used.

use std::path::{Path, PathBuf};

use glam::Vec2;

use super::ObjFault;
use crate::geometry::{AlphaMask, Wrap};
use crate::io::texture::{Channel, Texture};
use crate::io::{Limits, LoadError, file};

/// A material, with the place of its cut-out.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Material {
    pub(super) name: String,
    pub(super) cutout: Option<Cutout>,
}

/// A `map_d` statement.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cutout {
    mtl: PathBuf,
    line: usize,
    texture: String,
    scale: Vec2,
    offset: Vec2,
    wrap: Wrap,
}

/// Reads the materials of an MTL file.
///
/// # Errors
/// [`LoadError::Obj`] for a statement without its name, [`LoadError::Read`] for an unreadable file.
pub(super) fn load(path: &Path, limits: &Limits) -> Result<Vec<Material>, LoadError> {
    let bytes = file::read(path, limits)?;
    let text = String::from_utf8_lossy(&bytes);
    let mut materials: Vec<Material> = Vec::new();
    for (index, statement) in text.lines().enumerate() {
        let line = index + 1;
        let at_line = |fault| LoadError::Obj { path: path.to_owned(), line, fault };
        let statement = statement.trim();
        if statement.contains('\0') {
            return Err(at_line(ObjFault::NotText(0)));
        }
        let (keyword, rest) = statement.split_once(char::is_whitespace).unwrap_or((statement, ""));
        match keyword {
            "newmtl" if rest.trim().is_empty() => return Err(at_line(ObjFault::Name("newmtl"))),
            "newmtl" => materials.push(Material { name: rest.trim().to_owned(), cutout: None }),
            "map_d" => {
                let mut cutout = Cutout::parse(rest).map_err(at_line)?;
                (cutout.mtl, cutout.line) = (path.to_owned(), line);
                let material = materials
                    .last_mut()
                    .ok_or_else(|| at_line(ObjFault::Statement("map_d before newmtl".to_owned())))?;
                material.cutout = Some(cutout);
            }
            _ => {}
        }
    }
    Ok(materials)
}

impl Cutout {
    /// Options, then the texture's name, which may hold blanks.
    fn parse(arguments: &str) -> Result<Self, ObjFault> {
        let (mut scale, mut offset, mut wrap) = (Vec2::ONE, Vec2::ZERO, Wrap::Repeat);
        let mut rest = arguments.trim();
        while rest.starts_with('-') {
            let (option, arguments) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
            rest = arguments.trim_start();
            match option {
                "-s" => scale = numbers(&mut rest, Vec2::ONE),
                "-o" => offset = numbers(&mut rest, Vec2::ZERO),
                "-t" => _ = numbers(&mut rest, Vec2::ZERO),
                "-clamp" => {
                    if word(&mut rest) == "on" {
                        wrap = Wrap::Clamp;
                    }
                }
                "-blendu" | "-blendv" | "-cc" | "-boost" | "-bm" | "-texres" | "-imfchan" | "-type" => {
                    word(&mut rest);
                }
                "-mm" => {
                    word(&mut rest);
                    word(&mut rest);
                }
                _ => return Err(ObjFault::Statement(option.to_owned())),
            }
        }
        if rest.is_empty() {
            return Err(ObjFault::Name("map_d"));
        }
        Ok(Self { mtl: PathBuf::new(), line: 0, texture: rest.to_owned(), scale, offset, wrap })
    }

    /// Reads the texture: its alpha where it has one, else its luminance; solid from one half. `None` if it
    /// cuts nothing out.
    pub(super) fn mask(&self, limits: &Limits) -> Result<Option<AlphaMask>, LoadError> {
        // Windows writes paths with backslashes.
        let relative = self.texture.replace('\\', "/");
        let path = self.mtl.parent().unwrap_or(Path::new("")).join(relative);
        let within = |source| LoadError::Within {
            path: self.mtl.clone(),
            element: format!("line {}: map_d", self.line),
            source: Box::new(source),
        };
        let texture = Texture::load(&path, Channel::AlphaOrLuminance, limits).map_err(within)?;
        Ok(texture.mask(1.0, 0.5, [self.wrap; 2]))
    }

    /// From the file's texture coordinates, whose origin is the lower left corner, to a mask's.
    pub(super) fn mask_uv(&self, uv: Vec2) -> Vec2 {
        let uv = uv * self.scale + self.offset;
        Vec2::new(uv.x, 1.0 - uv.y)
    }
}

/// Takes the next word off `text`.
fn word<'a>(text: &mut &'a str) -> &'a str {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    *text = rest.trim_start();
    word
}

/// Takes one to three numbers off `text`; of the first two, those that are missing are `default`.
fn numbers(text: &mut &str, default: Vec2) -> Vec2 {
    let mut found = default.to_array();
    for i in 0..3 {
        let mut rest = *text;
        let Ok(number) = word(&mut rest).parse::<f32>() else { break };
        if let Some(slot) = found.get_mut(i) {
            *slot = number;
        }
        *text = rest;
    }
    Vec2::from_array(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_told_from_the_name() {
        let cutout = Cutout::parse("-s 2 3 1 -o 0.5 -clamp on -mm 0 1 leaf mask.png").unwrap();
        assert_eq!((cutout.scale, cutout.offset), (Vec2::new(2.0, 3.0), Vec2::new(0.5, 0.0)));
        assert_eq!((cutout.texture.as_str(), cutout.wrap), ("leaf mask.png", Wrap::Clamp));
        assert_eq!(cutout.mask_uv(Vec2::new(0.25, 0.25)), Vec2::new(1.0, 0.25));
        assert_eq!(Cutout::parse(" "), Err(ObjFault::Name("map_d")));
        assert_eq!(Cutout::parse("-hue 3 a.png"), Err(ObjFault::Statement("-hue".into())));
    }
}
