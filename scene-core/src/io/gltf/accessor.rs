//! Accessors, checked against their buffers before anything is read or allocated.
//!
//! Read here and not by the `gltf` crate, whose readers index and allocate by what the file promises.

use gltf::json;
use json::accessor::{ComponentType, Type};
use json::validation::Checked;

use super::document::Document;
use crate::io::LoadError;

/// The elements of an accessor: every one of them is there.
pub(super) struct Elements<'d> {
    /// "accessors\[3\]", for messages.
    pub(super) name: String,
    /// How many there are.
    pub(super) count: usize,
    component: ComponentType,
    components: usize,
    normalized: bool,
    /// Stride and bytes; without it all elements are zero.
    base: Option<(usize, &'d [u8])>,
    /// Replaced elements in ascending order, and their values, densely packed.
    sparse: Option<(Vec<usize>, &'d [u8])>,
}

impl<'d> Elements<'d> {
    /// Looks up accessor `index`, which the element `from` refers to, and checks its ranges.
    pub(super) fn new(
        document: &'d Document<'_>,
        index: json::Index<json::Accessor>,
        from: &str,
    ) -> Result<Self, LoadError> {
        let accessor = document.get(&document.root.accessors, index, "accessors", from)?;
        let name = format!("accessors[{}]", index.value());
        let fault = |message: String| document.fault(name.clone(), message);
        let Checked::Valid(json::accessor::GenericComponentType(component)) = accessor.component_type else {
            return Err(fault("componentType is none of 5120, 5121, 5122, 5123, 5125 and 5126".to_owned()));
        };
        let Checked::Valid(kind @ (Type::Scalar | Type::Vec2 | Type::Vec3 | Type::Vec4)) = accessor.type_
        else {
            return Err(fault("type is none of SCALAR, VEC2, VEC3 and VEC4".to_owned()));
        };
        let components = kind.multiplicity();
        let size = component.size() * components;
        let count = accessor.count.0;
        let base = accessor
            .buffer_view
            .map(|view| {
                let stride = document
                    .get(&document.root.buffer_views, view, "bufferViews", &name)?
                    .byte_stride
                    .map_or(size, |stride| stride.0);
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let bytes = slice(document, &name, view, offset, stride, size, count)?;
                Ok((stride, bytes))
            })
            .transpose()?;
        if base.is_none() {
            // Nothing in the file vouches for the count; what is replaced in it should be comparable.
            let bytes: u64 = document.buffers.iter().map(|b| b.len() as u64).sum();
            if count > bytes.max(1 << 16) {
                return Err(fault(format!("{count} elements without data are more than the file has bytes")));
            }
        }
        let sparse = accessor
            .sparse
            .as_ref()
            .map(|sparse| {
                let indices = sparse_indices(document, &name, sparse, count)?;
                let offset = sparse.values.byte_offset.0;
                let values =
                    slice(document, &name, sparse.values.buffer_view, offset, size, size, sparse.count.0)?;
                Ok((indices, values))
            })
            .transpose()?;
        let (count, normalized) = (count as usize, accessor.normalized);
        Ok(Self { name, count, component, components, normalized, base, sparse })
    }

    /// Whether elements are `N` numbers each.
    pub(super) fn has_components(&self, n: usize) -> bool {
        self.components == n
    }

    /// Whether these are unsigned integers, as vertex indices must be.
    pub(super) fn are_indices(&self) -> bool {
        self.components == 1
            && matches!(self.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32)
    }

    /// The bytes of element `i`; `None` for a zero.
    fn bytes(&self, i: usize) -> Option<&'d [u8]> {
        let size = self.component.size() * self.components;
        if let Some((indices, values)) = &self.sparse
            && let Ok(at) = indices.binary_search(&i)
        {
            return Some(&values[at * size..(at + 1) * size]);
        }
        self.base.map(|(stride, bytes)| &bytes[i * stride..i * stride + size])
    }

    /// Element `i` as `N` numbers; normalised integers become fractions.
    ///
    /// # Panics
    /// If `i` is out of range or elements have fewer numbers.
    pub(super) fn floats<const N: usize>(&self, i: usize) -> [f32; N] {
        let Some(bytes) = self.bytes(i) else { return [0.0; N] };
        let size = self.component.size();
        std::array::from_fn(|k| self.float(&bytes[k * size..(k + 1) * size]))
    }

    fn float(&self, bytes: &[u8]) -> f32 {
        let fraction = |value: f32, largest: f32| {
            if self.normalized { (value / largest).max(-1.0) } else { value }
        };
        match (self.component, bytes) {
            (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
            (ComponentType::I8, &[a]) => fraction(f32::from(a as i8), 127.0),
            (ComponentType::U8, &[a]) => fraction(f32::from(a), 255.0),
            (ComponentType::I16, &[a, b]) => fraction(f32::from(i16::from_le_bytes([a, b])), 32_767.0),
            (ComponentType::U16, &[a, b]) => fraction(f32::from(u16::from_le_bytes([a, b])), 65_535.0),
            _ => 0.0,
        }
    }

    /// All elements as indices; see [`are_indices`](Self::are_indices).
    pub(super) fn indices(&self) -> Vec<u32> {
        if let (None, Some((stride, bytes))) = (&self.sparse, self.base)
            && stride == self.component.size()
        {
            return match self.component {
                ComponentType::U8 => bytes.iter().map(|&b| u32::from(b)).collect(),
                ComponentType::U16 => {
                    bytes.as_chunks().0.iter().map(|&b| u32::from(u16::from_le_bytes(b))).collect()
                }
                _ => bytes.as_chunks().0.iter().map(|&b| u32::from_le_bytes(b)).collect(),
            };
        }
        (0..self.count).map(|i| self.bytes(i).map_or(0, unsigned)).collect()
    }
}

/// A little-endian number of one to four bytes.
fn unsigned(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// The bytes from the first to the last of `count` elements; the offset is relative to the view.
fn slice<'d>(
    document: &'d Document<'_>,
    name: &str,
    view: json::Index<json::buffer::View>,
    offset: u64,
    stride: usize,
    size: usize,
    count: u64,
) -> Result<&'d [u8], LoadError> {
    document.get(&document.root.buffer_views, view, "bufferViews", name)?;
    let bytes = document.view(view.value())?;
    if count == 0 {
        return Ok(&[]);
    }
    if stride < size {
        let message =
            format!("its elements have {size} bytes, but bufferViews[{}] a stride of {stride}", view.value());
        return Err(document.fault(name, message));
    }
    let end = (count - 1)
        .checked_mul(stride as u64)
        .and_then(|last| last.checked_add(offset)?.checked_add(size as u64))
        .filter(|&end| end <= bytes.len() as u64);
    match end {
        Some(end) => Ok(&bytes[offset as usize..end as usize]),
        None => Err(document.fault(
            name,
            format!(
                "{count} elements of {size} bytes from byte {offset} on reach beyond bufferViews[{}], which has {} bytes",
                view.value(),
                bytes.len()
            ),
        )),
    }
}

fn sparse_indices(
    document: &Document<'_>,
    name: &str,
    sparse: &json::accessor::sparse::Sparse,
    count: u64,
) -> Result<Vec<usize>, LoadError> {
    let fault = |message: String| document.fault(format!("{name}.sparse"), message);
    let Checked::Valid(json::accessor::IndexComponentType(component)) = sparse.indices.component_type else {
        return Err(fault("componentType of the indices is none of 5121, 5123 and 5125".to_owned()));
    };
    let size = component.size();
    let (view, offset) = (sparse.indices.buffer_view, sparse.indices.byte_offset.0);
    let bytes = slice(document, name, view, offset, size, size, sparse.count.0)?;
    let indices: Vec<usize> = bytes.chunks_exact(size).map(|b| unsigned(b) as usize).collect();
    if let Some(&last) = indices.last()
        && last as u64 >= count
    {
        return Err(fault(format!("index {last} is not below the accessor's count, {count}")));
    }
    match indices.windows(2).position(|pair| pair[0] >= pair[1]) {
        Some(at) => Err(fault(format!("index {at} is not smaller than the next"))),
        None => Ok(indices),
    }
}
