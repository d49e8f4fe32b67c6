//! Writers: PNG, EXR, `.npy`, JSON, bytes.
//!
//! Each writes a temporary file in the target's folder and renames it when all is written, so that a reader
//! never sees half a file and a failure leaves the old one.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::codecs::openexr::OpenExrEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use npyz::{AutoSerialize, WriterBuilder};
use serde::Serialize;
use thiserror::Error;

use crate::VisibilityImage;

/// Why a file could not be written.
#[derive(Debug, Error)]
pub enum WriteError {
    /// The system refused: no such folder, no permission, no space.
    #[error("{}: cannot be written: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The values do not fill the picture or array.
    #[error("{}: {values} values do not fill {width} × {height}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Values there are.
        values: usize,
        /// Values a row.
        width: u32,
        /// Rows.
        height: u32,
    },
}

/// Writes `bytes`.
///
/// # Errors
/// [`WriteError::Io`]; the old file is untouched then.
pub fn bytes(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    atomically(path, |file| file.write_all(bytes))
}

/// Writes `value` as indented JSON with a line feed at its end. A float that is not finite becomes `null`.
///
/// # Errors
/// [`WriteError::Io`], also for a value that JSON cannot hold (a map whose keys are no strings).
pub fn json(path: &Path, value: &impl Serialize) -> Result<(), WriteError> {
    atomically(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        file.write_all(b"\n")
    })
}

/// Writes visibility as an 8-bit grey PNG: 0 is black, 1 white, linear in V. Pixels where nothing is seen
/// (NaN) are transparent; without any, the picture has no alpha channel. Values outside [0, 1] are clamped.
///
/// # Errors
/// [`WriteError::Size`] for an image whose values do not fill it, [`WriteError::Io`].
pub fn visibility_png(path: &Path, image: &VisibilityImage) -> Result<(), WriteError> {
    check_size(path, image.values.len(), image.width, image.height)?;
    let level = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    let (pixels, color): (Vec<u8>, _) = if image.values.iter().any(|v| v.is_nan()) {
        let pixel = |&v: &f32| if v.is_nan() { [0, 0] } else { [level(v), 255] };
        (image.values.iter().flat_map(pixel).collect(), ExtendedColorType::La8)
    } else {
        (image.values.iter().map(|&v| level(v)).collect(), ExtendedColorType::L8)
    };
    png(path, &pixels, image.width, image.height, color)
}

/// Writes an 8-bit colour PNG from sRGB pixels, row by row.
///
/// # Errors
/// [`WriteError::Size`] unless there are `width` × `height` pixels, [`WriteError::Io`].
pub fn color_png(path: &Path, pixels: &[[u8; 3]], width: u32, height: u32) -> Result<(), WriteError> {
    check_size(path, pixels.len(), width, height)?;
    png(path, pixels.as_flattened(), width, height, ExtendedColorType::Rgb8)
}

fn png(
    path: &Path,
    pixels: &[u8],
    width: u32,
    height: u32,
    color: ExtendedColorType,
) -> Result<(), WriteError> {
    atomically(path, |file| {
        PngEncoder::new(file).write_image(pixels, width, height, color).map_err(io::Error::other)
    })
}

/// Writes an EXR picture of linear 32-bit floats, the same value in R, G and B; NaN stays NaN.
///
/// # Errors
/// [`WriteError::Size`] unless there are `width` × `height` values, [`WriteError::Io`].
pub fn exr(path: &Path, values: &[f32], width: u32, height: u32) -> Result<(), WriteError> {
    check_size(path, values.len(), width, height)?;
    let bytes: Vec<u8> = values.iter().flat_map(|&v| [v; 3]).flat_map(f32::to_ne_bytes).collect();
    let mut encoded = io::Cursor::new(Vec::new());
    OpenExrEncoder::new(&mut encoded)
        .write_image(&bytes, width, height, ExtendedColorType::Rgb32F)
        .map_err(|error| WriteError::Io { path: path.to_owned(), source: io::Error::other(error) })?;
    self::bytes(path, &encoded.into_inner())
}

/// Writes a `NumPy` array of float32, H × W.
///
/// # Errors
/// [`WriteError::Size`] unless there are `width` × `height` values, [`WriteError::Io`].
pub fn npy_f32(path: &Path, values: &[f32], width: u32, height: u32) -> Result<(), WriteError> {
    check_size(path, values.len(), width, height)?;
    npy(path, values.iter().copied(), &[height.into(), width.into()])
}

/// Writes a `NumPy` array of bool, H × W.
///
/// # Errors
/// [`WriteError::Size`] unless there are `width` × `height` values, [`WriteError::Io`].
pub fn npy_bool(path: &Path, values: &[bool], width: u32, height: u32) -> Result<(), WriteError> {
    check_size(path, values.len(), width, height)?;
    npy(path, values.iter().copied(), &[height.into(), width.into()])
}

/// Writes a `NumPy` array of float32, H × W × 3.
///
/// # Errors
/// [`WriteError::Size`] unless there are `width` × `height` vectors, [`WriteError::Io`].
pub fn npy_vec3(path: &Path, values: &[Vec3], width: u32, height: u32) -> Result<(), WriteError> {
    check_size(path, values.len(), width, height)?;
    npy(path, values.iter().flat_map(|v| v.to_array()), &[height.into(), width.into(), 3])
}

fn npy<T: AutoSerialize>(
    path: &Path,
    values: impl Iterator<Item = T>,
    shape: &[u64],
) -> Result<(), WriteError> {
    atomically(path, |file| {
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(file).begin_nd()?;
        writer.extend(values)?;
        writer.finish()
    })
}

fn check_size(path: &Path, values: usize, width: u32, height: u32) -> Result<(), WriteError> {
    if values as u64 == u64::from(width) * u64::from(height) && values > 0 {
        Ok(())
    } else {
        Err(WriteError::Size { path: path.to_owned(), values, width, height })
    }
}

/// Runs `fill` on a temporary file beside `path`, then renames it to `path`.
fn atomically(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<&mut File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let write = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut builder = tempfile::Builder::new();
        builder.prefix(".gnomon-");
        #[cfg(unix)]
        {
            // As any new file: what the user's mask leaves. Temporary files are private otherwise.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let mut temporary = builder.tempfile_in(folder.unwrap_or(Path::new(".")))?;
        let mut buffered = BufWriter::new(temporary.as_file_mut());
        fill(&mut buffered)?;
        buffered.flush()?;
        drop(buffered);
        temporary.persist(path).map_err(|error| error.error)?;
        Ok(())
    };
    write().map_err(|source| WriteError::Io { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visibility_survives_png_exr_and_npy() {
        let folder = tempfile::tempdir().unwrap();
        let image = VisibilityImage { width: 3, height: 2, values: vec![0.0, 0.5, 1.0, f32::NAN, 2.0, -1.0] };
        let path = folder.path().join("v.png");
        visibility_png(&path, &image).unwrap();
        let read = image::open(&path).unwrap().to_luma_alpha8();
        let pixels: Vec<_> = read.pixels().map(|p| p.0).collect();
        assert_eq!(pixels, [[0, 255], [128, 255], [255, 255], [0, 0], [255, 255], [0, 255]]);

        let path = folder.path().join("v.exr");
        exr(&path, &image.values, 3, 2).unwrap();
        let read = image::open(&path).unwrap().to_rgb32f();
        assert_eq!(read.get_pixel(1, 0).0, [0.5; 3]);
        assert!(read.get_pixel(0, 1).0[0].is_nan());

        let path = folder.path().join("v.npy");
        npy_f32(&path, &image.values, 3, 2).unwrap();
        let file = npyz::NpyFile::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(file.shape(), [2, 3]);
        assert_eq!(file.into_vec::<f32>().unwrap()[..3], image.values[..3]);
    }

    #[test]
    fn arrays_have_their_types_and_shapes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npy");
        npy_bool(&path, &[true, false], 1, 2).unwrap();
        let file = npyz::NpyFile::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!((file.shape(), file.dtype().descr()), (&[2, 1][..], "'|b1'".to_owned()));
        npy_vec3(&path, &[Vec3::new(1.0, 2.0, 3.0)], 1, 1).unwrap();
        let file = npyz::NpyFile::new(std::fs::File::open(&path).unwrap()).unwrap();
        assert_eq!(file.shape(), [1, 1, 3]);
        assert_eq!(file.into_vec::<f32>().unwrap(), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn nothing_is_left_behind() {
        let folder = tempfile::tempdir().unwrap();
        bytes(&folder.path().join("a.txt"), b"one").unwrap();
        bytes(&folder.path().join("a.txt"), b"two").unwrap();
        json(&folder.path().join("b.json"), &[f32::NAN, 1.0]).unwrap();
        let missing = folder.path().join("no/such/folder.png");
        let error = color_png(&missing, &[[1, 2, 3]], 1, 1).unwrap_err().to_string();
        assert!(error.contains("folder.png"), "{error}");
        // A target that cannot be replaced: the temporary file goes away.
        assert!(bytes(folder.path(), b"three").is_err());
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["a.txt", "b.json"]);
        assert_eq!(std::fs::read(folder.path().join("a.txt")).unwrap(), b"two");
        assert_eq!(std::fs::read_to_string(folder.path().join("b.json")).unwrap(), "[\n  null,\n  1.0\n]\n");
    }

    #[test]
    fn pictures_must_be_filled() {
        let path = Path::new("never.png");
        assert!(matches!(color_png(path, &[], 0, 0), Err(WriteError::Size { .. })));
        assert!(matches!(exr(path, &[1.0], 2, 1), Err(WriteError::Size { values: 1, .. })));
        assert!(matches!(npy_bool(path, &[true; 5], 2, 2), Err(WriteError::Size { .. })));
    }
}
