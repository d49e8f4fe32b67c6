//! A glTF file's container, JSON and buffers.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json;
use percent_encoding::percent_decode_str;

use crate::io::scene_file::json_message;
use crate::io::{Limits, LoadError, file};

/// Extensions that a file may require because they change nothing that is read here, or because they are
/// understood. Those of materials (`KHR_materials_…`) are too.
const UNDERSTOOD: [&str; 6] = [
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "KHR_xmp_json_ld",
    "KHR_animation_pointer",
    "KHR_node_visibility",
];

/// A parsed glTF file with its buffers.
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) limits: &'a Limits,
    pub(super) root: json::Root,
    pub(super) buffers: Vec<Arc<Vec<u8>>>,
}

impl<'a> Document<'a> {
    /// Reads the file and all its buffers.
    pub(super) fn load(path: &'a Path, limits: &'a Limits) -> Result<Self, LoadError> {
        let bytes = file::read(path, limits)?;
        let (root, blob) = if bytes.starts_with(b"glTF") {
            let (text, blob) = split_binary(path, &bytes)?;
            (parse(path, text)?, blob.map(<[u8]>::to_vec))
        } else if file::extension(path) == "glb" {
            let message = "this is no binary glTF file: it does not begin with 'glTF'".to_owned();
            return Err(LoadError::File { path: path.to_owned(), message });
        } else {
            (parse(path, &bytes)?, None)
        };
        let mut document = Self { path, limits, root, buffers: Vec::new() };
        document.check_version_and_extensions()?;
        document.load_buffers(blob)?;
        Ok(document)
    }

    /// An error at an element.
    pub(super) fn fault(&self, element: impl Into<String>, message: impl Into<String>) -> LoadError {
        LoadError::Element { path: self.path.to_owned(), element: element.into(), message: message.into() }
    }

    /// Element `index` of `list`, which `from` refers to and which is called `name`.
    pub(super) fn get<'d, T, U>(
        &self,
        list: &'d [T],
        index: json::Index<U>,
        name: &str,
        from: &str,
    ) -> Result<&'d T, LoadError> {
        list.get(index.value()).ok_or_else(|| {
            let message = match list.len() {
                0 => format!("refers to {name}[{}], but there are no {name}", index.value()),
                1 => format!("refers to {name}[{}], but there is only {name}[0]", index.value()),
                n => format!("refers to {name}[{}], but there are {n} (0 to {})", index.value(), n - 1),
            };
            self.fault(from, message)
        })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8], LoadError> {
        let element = format!("bufferViews[{index}]");
        let view = &self.root.buffer_views[index];
        let buffer = self.get(&self.buffers, view.buffer, "buffers", &format!("{element}.buffer"))?;
        let start = view.byte_offset.unwrap_or_default().0;
        let end = start.checked_add(view.byte_length.0).filter(|&end| end <= buffer.len() as u64);
        match end {
            Some(end) => Ok(&buffer[start as usize..end as usize]),
            None => Err(self.fault(
                element,
                format!(
                    "bytes {start} and {} more reach beyond buffers[{}], which has {}",
                    view.byte_length.0,
                    view.buffer.value(),
                    buffer.len()
                ),
            )),
        }
    }

    /// The bytes that a URI stands for: its own, or those of a file beside this one.
    pub(super) fn resolve(&self, uri: &str, element: &str) -> Result<Vec<u8>, LoadError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let broken = |why: String| self.fault(element, format!("the data URI is broken: {why}"));
            let (kind, data) =
                data.split_once(',').ok_or_else(|| broken("there is no comma in it".to_owned()))?;
            if kind.ends_with(";base64") {
                return BASE64.decode(data).map_err(|error| broken(error.to_string()));
            }
            return Ok(percent_decode_str(data).collect());
        }
        let path = self.file_of(uri, element)?;
        file::read(&path, self.limits).map_err(|source| LoadError::Within {
            path: self.path.to_owned(),
            element: element.to_owned(),
            source: Box::new(source),
        })
    }

    /// The file a URI names, relative to this one.
    fn file_of(&self, uri: &str, element: &str) -> Result<PathBuf, LoadError> {
        let scheme = uri.split_once(':').map(|(scheme, _)| scheme);
        if scheme.is_some_and(|s| s.len() > 1 && s.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'+')) {
            return Err(self.fault(element, "only files beside this one and data URIs are read"));
        }
        let name = percent_decode_str(uri).decode_utf8_lossy().into_owned();
        if name.is_empty() || name.contains('\0') {
            return Err(self.fault(element, "this is no file name"));
        }
        Ok(self.path.parent().unwrap_or(Path::new("")).join(name))
    }

    fn check_version_and_extensions(&self) -> Result<(), LoadError> {
        let version = &self.root.asset.version;
        if version.split('.').next() != Some("2") {
            return Err(self.fault("asset.version", format!("version '{version}' is not 2.x")));
        }
        for extension in &self.root.extensions_required {
            if !UNDERSTOOD.contains(&extension.as_str()) && !extension.starts_with("KHR_materials_") {
                return Err(self.fault(
                    "extensionsRequired",
                    format!("the file cannot be read without {extension}, which is not supported"),
                ));
            }
        }
        Ok(())
    }

    fn load_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<(), LoadError> {
        // Several buffers may name one file; it is held once.
        let mut by_uri: HashMap<&str, Arc<Vec<u8>>> = HashMap::new();
        let (mut buffers, mut total) = (Vec::new(), 0u64);
        for (index, buffer) in self.root.buffers.iter().enumerate() {
            let element = format!("buffers[{index}]");
            let data = match &buffer.uri {
                Some(uri) if by_uri.contains_key(uri.as_str()) => by_uri[uri.as_str()].clone(),
                Some(uri) => {
                    let data = Arc::new(self.resolve(uri, &format!("{element}.uri"))?);
                    by_uri.insert(uri, data.clone());
                    total += data.len() as u64;
                    data
                }
                None if index == 0 && blob.is_some() => Arc::new(blob.take().unwrap_or_default()),
                None => return Err(self.fault(element, "has no uri, and the file no binary chunk for it")),
            };
            let (length, said) = (data.len() as u64, buffer.byte_length.0);
            if length < said {
                return Err(self.fault(element, format!("has {length} bytes, though byteLength is {said}")));
            }
            if total > self.limits.file_bytes {
                let (path, limit) = (self.path.to_owned(), self.limits.file_bytes);
                return Err(LoadError::TooLarge { path, what: "bytes in buffers", count: total, limit });
            }
            buffers.push(data);
        }
        self.buffers = buffers;
        Ok(())
    }
}

/// Base 64 as files have it: with or without padding.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// The JSON text and the binary chunk of a `.glb` file.
fn split_binary<'b>(path: &Path, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>), LoadError> {
    let fault = |element: &str, message: String| LoadError::Element {
        path: path.to_owned(),
        element: element.to_owned(),
        message,
    };
    let word =
        |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
    if bytes.len() < 20 {
        return Err(fault("header", format!("the file is cut off after {} bytes", bytes.len())));
    }
    if word(4) != 2 {
        return Err(fault("header", format!("version {} of binary glTF is not 2", word(4))));
    }
    let length = word(8) as usize;
    if length < 20 || length > bytes.len() {
        let message = format!("the file should have {length} bytes, but has {}", bytes.len());
        return Err(fault("header", message));
    }
    let bytes = &bytes[..length];
    let chunk = |at: usize, kind: &[u8; 4], name: &str| {
        let end = (at + 8).checked_add(word(at) as usize).filter(|&end| end <= bytes.len());
        match (bytes.get(at + 4..at + 8) == Some(kind), end) {
            (true, Some(end)) => Ok((&bytes[at + 8..end], end)),
            (true, None) => {
                Err(fault(name, format!("its {} bytes reach beyond the end of the file", word(at))))
            }
            (false, _) => Err(fault(name, "there is no such chunk where it should be".to_owned())),
        }
    };
    let (text, end) = chunk(12, b"JSON", "JSON chunk")?;
    let next = end.next_multiple_of(4);
    let has_binary = next + 8 <= bytes.len();
    let blob = if has_binary { Some(chunk(next, b"BIN\0", "BIN chunk")?.0) } else { None };
    Ok((text, blob))
}

fn parse(path: &Path, text: &[u8]) -> Result<json::Root, LoadError> {
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let (element, error) = (error.path().to_string(), error.into_inner());
        LoadError::Syntax {
            path: path.to_owned(),
            line: error.line(),
            column: error.column(),
            message: json_message(&element, &error),
        }
    })
}
