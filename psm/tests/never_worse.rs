//! `auto` is never worse than `uniform`, in a small version of what the example `directions` prints.

mod directions;

use std::fmt::Write;

use gnomon_psm::Variant;

/// Counts are rounded to two digits: a texel that another processor's rounding moves changes a pixel or two.
fn rounded(count: usize) -> usize {
    let step = 10usize.pow((count.max(1).ilog10()).saturating_sub(1));
    (count + step / 2) / step * step
}

/// At this size a few hundred pixels are wrong, and where an edge falls in its texel is chance: the difference of two
/// such counts has a standard deviation of at most the root of their sum. That much is let pass here; the example's
/// pictures are large enough to do without.
#[test]
fn auto_is_never_worse_than_uniform() {
    let specs = ["chess", "street", "forest:triangles=60000", "park:leaves=800"];
    let mut table = String::from(
        "wrong pixels of 160 × 120, maps of 256 × 256\nscene | light | auto | psm | lispsm | uniform\n",
    );
    let mut worse = Vec::new();
    directions::visit_rows(&specs, [160, 120], |scene, light, row| {
        let wrong: Vec<usize> = row.of_all(256).into_iter().map(|(wrong, _)| wrong).collect();
        let (auto, uniform) = (wrong[0], wrong[Variant::ALL.len() - 1]);
        if auto as f64 > 1.02 * uniform as f64 + ((auto + uniform) as f64).sqrt() {
            worse.push(format!("{scene}, {light}: {auto}, uniform {uniform}"));
        }
        let [auto, psm, lispsm, uniform] = [0, 1, 2, 3].map(|i| rounded(wrong[i]));
        writeln!(table, "{scene} | {light} | {auto} | {psm} | {lispsm} | {uniform}")
            .expect("a string takes everything");
    });
    assert!(worse.is_empty(), "{worse:#?}\n{table}");
    insta::assert_snapshot!(table);
}
