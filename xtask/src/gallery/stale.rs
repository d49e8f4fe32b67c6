//! Whether a figure still shows what the command draws.
//!
//! Pictures of two machines differ in rounding, so they are compared within what rounding can do:
//! - A channel may differ by [`STEP`]. V may differ by 1/255 between machines; a colour answers to V by at most 5 (light
//!   times albedo at most 1.2, tone curve 1.25, sRGB in shade 3.4), and 1 is for its own rounding.
//! - One pixel in a thousand may differ more: ties of rasterisation, as with golden pictures.
//! - The last digit of the error below each image may differ, which changes one glyph of [`GLYPH`] pixels.

/// Largest difference of a channel, of 255.
const STEP: u8 = 6;

/// Pixels of a glyph: 8 × 16, and a pixel of border.
const GLYPH: usize = 9 * 17;

/// An RGB image.
#[derive(Debug, PartialEq, Eq)]
struct Pixels {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

/// Why the figure kept in a file has to be made anew; `None` if it shows what `made` shows.
pub(super) fn why(kept: Option<&[u8]>, made: &[u8], captions: usize) -> Option<String> {
    let Some(kept) = kept else { return Some("it is missing".to_owned()) };
    let (kept, made) = match (decode(kept), decode(made)) {
        (Ok(kept), Ok(made)) => (kept, made),
        (Err(error), _) => return Some(format!("it cannot be read: {error}")),
        (_, Err(error)) => return Some(format!("the new one cannot be read: {error}")),
    };
    if (kept.width, kept.height) != (made.width, made.height) {
        return Some(format!(
            "stale: {}x{} pixels, now {}x{}",
            kept.width, kept.height, made.width, made.height
        ));
    }
    let pairs = kept.rgb.chunks(3).zip(made.rgb.chunks(3));
    let differ = |(a, b): &(&[u8], &[u8])| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > STEP);
    let wrong = pairs.filter(differ).count();
    let allowed = kept.rgb.len() / 3 / 1000 + captions * GLYPH;
    (wrong > allowed).then(|| format!("stale: {wrong} pixels differ, at most {allowed} may"))
}

fn decode(bytes: &[u8]) -> Result<Pixels, String> {
    let text = |error: png::DecodingError| error.to_string();
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().map_err(text)?;
    let mut rgb = vec![0; reader.output_buffer_size().ok_or("it is too large")?];
    let info = reader.next_frame(&mut rgb).map_err(text)?;
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgb, png::BitDepth::Eight) {
        return Err(format!("{:?} of {:?} bits, not RGB of 8", info.color_type, info.bit_depth));
    }
    rgb.truncate(info.buffer_size());
    Ok(Pixels { width: info.width, height: info.height, rgb })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, pixel: impl Fn(u32, u32) -> u8) -> Vec<u8> {
        let rgb: Vec<u8> = (0..100 * width).flat_map(|i| [pixel(i % width, i / width), 100, 100]).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, 100);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(&rgb).unwrap();
        bytes
    }

    #[test]
    fn rounding_and_a_digit_a_caption_pass() {
        let kept = picture(100, |_, _| 100);
        assert_eq!(why(Some(&kept), &picture(100, |x, _| 100 + (x % 7) as u8), 2), None);
        // Two glyphs, and ten pixels of 10,000.
        let digits = picture(100, |x, y| if y < 18 && x < 17 || y == 50 && x < 10 { 200 } else { 100 });
        assert_eq!(why(Some(&kept), &digits, 2), None);
    }

    #[test]
    fn what_looks_different_is_stale() {
        let kept = picture(100, |_, _| 100);
        let planted = [
            picture(100, |_, _| 107),
            picture(100, |x, y| if y < 18 && x < 18 { 200 } else { 100 }),
            picture(101, |_, _| 100),
        ];
        for made in planted {
            assert!(why(Some(&kept), &made, 2).is_some());
        }
        assert_eq!(why(None, &kept, 2), Some("it is missing".to_owned()));
        assert!(why(Some(b"no picture"), &kept, 2).is_some());
    }
}
