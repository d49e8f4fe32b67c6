//! Figures 1 to 4 and 6 of the paper in kind:
//! `cargo run --release -p gnomon-contact-hardening --example figures [FOLDER]` writes `figure-1.png` and so on. Figure 5, the
//! row A to G, is `--example rows`, and figure 7 `--example poisson`.

mod shared;

use std::error::Error;
use std::path::PathBuf;

use gnomon_contact_hardening::kernel::poisson_points;
use gnomon_contact_hardening::{ContactHardening, ContactHardeningParams, Show, Variant};
use scene_core::VisibilityImage;
use scene_core::io::write;
use shared::{Case, as_published, in_rows};

/// Pixels a picture.
const SIZE: [u32; 2] = [240, 180];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| ".".to_owned()));
    let write = |number: u32, image: &VisibilityImage| {
        write::visibility_png(&folder.join(format!("figure-{number}.png")), image)
    };
    write(1, &approaches("pool")?)?;
    write(2, &dilation()?)?;
    write(3, &approaches("log-cabin")?)?;
    write(4, &heights()?)?;
    write(6, &coverage())?;
    Ok(())
}

fn draw(case: &Case, params: ContactHardeningParams) -> Result<VisibilityImage, Box<dyn Error>> {
    Ok(case.run(&ContactHardening::new(params))?.0)
}

/// Ground truth and the three approaches.
fn approaches(scene: &str) -> Result<VisibilityImage, Box<dyn Error>> {
    let case = Case::new(scene, SIZE, 256)?;
    let mut images = vec![case.truth.clone()];
    for variant in Variant::ALL {
        images.push(draw(&case, ContactHardeningParams { variant, ..Default::default() })?);
    }
    Ok(in_rows(&images, 2))
}

/// The fence as published, with `pcf`: without and with the dilation of D.
fn dilation() -> Result<VisibilityImage, Box<dyn Error>> {
    let case = Case::new("fence", SIZE, 1)?;
    let params = as_published(Variant::Pcf, 12.0);
    let images = [draw(&case, params)?, draw(&case, ContactHardeningParams { dilate: 9, ..params })?];
    Ok(in_rows(&images, 2))
}

/// The ball higher and higher, its penumbra marked.
fn heights() -> Result<VisibilityImage, Box<dyn Error>> {
    let mut images = Vec::new();
    for height in ["0", "0.4", "0.8", "1.2"] {
        let case = Case::new(&format!("ball:height={height}"), SIZE, 1)?;
        images.push(draw(&case, ContactHardeningParams { show: Show::Penumbra, ..Default::default() })?);
    }
    Ok(in_rows(&images, 2))
}

/// 50 points of kernels of 3, 5 and 7 pixels.
fn coverage() -> VisibilityImage {
    const SIDE: usize = 7 * 24;
    let points = poisson_points(50, 0);
    let images = [3, 5, 7].map(|kernel| {
        let mut image = VisibilityImage::new(SIDE as u32, SIDE as u32);
        let cell = SIDE / 7;
        // Lines between pixels, and grey beyond the kernel.
        let margin = (7 - kernel) / 2 * cell;
        for (index, value) in image.values.iter_mut().enumerate() {
            let (x, y) = (index % SIDE, index / SIDE);
            let is_outside = [x, y].iter().any(|&at| at < margin || at >= SIDE - margin);
            let is_line = x % cell == 0 || y % cell == 0;
            *value = if is_outside {
                0.9
            } else if is_line {
                0.75
            } else {
                1.0
            };
        }
        // As the blur takes them: `kernel` pixels reach (kernel - 1)/2 to each side of the middle's own middle.
        let radius = ((kernel - 1) / 2 * cell) as f32;
        for point in &points {
            let middle = *point * radius + SIDE as f32 * 0.5;
            for y in -2i32..=2 {
                for x in -2i32..=2 {
                    let at = [middle.x as i32 + x, middle.y as i32 + y]
                        .map(|at| at.clamp(0, SIDE as i32 - 1) as usize);
                    if x * x + y * y <= 5 {
                        image.values[at[1] * SIDE + at[0]] = 0.0;
                    }
                }
            }
        }
        image
    });
    in_rows(&images, 3)
}
