//! Wrong pixels of every variant against one shadow ray a pixel: chess, street, forest and park under light from eight
//! directions.
//!
//! `cargo run --release -p gnomon-psm --example directions -- [MAP_SIZE] [IMAGE_SIZE]`; 512 and 512 unless told.

#[path = "../tests/directions/mod.rs"]
mod directions;

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<u32>());
    let map_size = arguments.next().unwrap_or(Ok(512))?;
    let side = arguments.next().unwrap_or(Ok(512))?;
    println!("wrong pixels of {side} × {side}, maps of {map_size} × {map_size}; d: pixels a texel");
    println!(
        "scene | light | auto | psm | lispsm | uniform | auto / uniform | auto took | d uniform: median, p99 | d auto: median, p99"
    );
    println!("--- | --- | --- | --- | --- | --- | --- | --- | --- | ---");
    let mut worst = 0.0f64;
    let specs = ["chess", "street", "forest:triangles=1000000", "park"];
    directions::visit_rows(&specs, [side, side], |scene, light, row| {
        let rows = row.of_all(map_size);
        let [auto, psm, lispsm, uniform] = [0, 1, 2, 3].map(|i| rows[i].0);
        let ratio = auto as f64 / uniform.max(1) as f64;
        worst = worst.max(ratio);
        let view = |i: usize| rows[i].1.maps().first().map(|map| map.view);
        let took = view(0).map_or("no map".to_owned(), |v| format!("{:?}", v.parametrisation));
        let d = |i: usize| {
            let d = view(i).map(|v| v.aliasing).unwrap_or_default();
            format!("{:.2}, {:.2}", d.median, d.p99)
        };
        println!(
            "{scene} | {light} | {auto} | {psm} | {lispsm} | {uniform} | {ratio:.3} | {took} | {} | {}",
            d(3),
            d(0)
        );
    });
    println!("worst auto / uniform: {worst:.3}");
    Ok(())
}
