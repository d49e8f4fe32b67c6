//! Ridge regression on standardised features.

/// Penalty on the squares of weights of standardised features: as much as one scene more that says they are 0.
const PENALTY: f64 = 1.0;

/// A linear function fitted to measurements.
#[derive(Clone, Debug)]
pub(crate) struct Regression {
    middle: Vec<f64>,
    spread: Vec<f64>,
    weights: Vec<f64>,
    intercept: f64,
    /// Root mean square of what it misses each measurement by when that one is left out.
    pub(crate) deviation: f64,
}

impl Regression {
    /// Fits `targets` on `rows` of features; none for fewer rows than features and two more, or for numbers that are not finite.
    pub(crate) fn new(rows: &[Vec<f64>], targets: &[f64]) -> Option<Self> {
        let (count, width) = (rows.len(), rows.first()?.len());
        let is_finite = rows.iter().flatten().chain(targets).all(|x| x.is_finite());
        if count < width + 2 || !is_finite {
            return None;
        }
        let mean = |values: &mut dyn Iterator<Item = f64>| values.sum::<f64>() / count as f64;
        let middle: Vec<f64> = (0..width).map(|i| mean(&mut rows.iter().map(|row| row[i]))).collect();
        let variance = |i: usize| mean(&mut rows.iter().map(|row| (row[i] - middle[i]).powi(2)));
        // A feature that is the same everywhere says nothing.
        let spread: Vec<f64> =
            (0..width).map(variance).map(|v: f64| if v > 1e-12 { v.sqrt() } else { f64::INFINITY }).collect();
        let standard = |row: &Vec<f64>| (0..width).map(|i| (row[i] - middle[i]) / spread[i]).collect();
        let x: Vec<Vec<f64>> = rows.iter().map(standard).collect();
        let intercept = mean(&mut targets.iter().copied());
        let y: Vec<f64> = targets.iter().map(|target| target - intercept).collect();
        let gram = |i: usize, j: usize| {
            x.iter().map(|row| row[i] * row[j]).sum::<f64>() + if i == j { PENALTY } else { 0.0 }
        };
        let lower = Lower::new(width, gram);
        let moments: Vec<f64> =
            (0..width).map(|i| x.iter().zip(&y).map(|(row, y)| row[i] * y).sum()).collect();
        let weights = lower.solve(&moments);
        // Left-out residuals without fitting anew: e / (1 − h), h the row's own leverage.
        let missed = x.iter().zip(&y).map(|(row, y)| {
            let leverage = 1.0 / count as f64 + dot(row, &lower.solve(row));
            ((y - dot(row, &weights)) / (1.0 - leverage).max(1e-3)).powi(2)
        });
        let deviation = (missed.sum::<f64>() / count as f64).sqrt();
        Some(Self { middle, spread, weights, intercept, deviation })
    }

    /// Its value.
    pub(crate) fn at(&self, features: &[f64]) -> f64 {
        let standard = features
            .iter()
            .zip(&self.middle)
            .zip(&self.spread)
            .map(|((x, middle), spread)| (x - middle) / spread);
        self.intercept + standard.zip(&self.weights).map(|(x, weight)| weight * x).sum::<f64>()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The Cholesky factor of a positive definite matrix: a ridge makes every Gram matrix one.
struct Lower(Vec<Vec<f64>>);

impl Lower {
    fn new(size: usize, matrix: impl Fn(usize, usize) -> f64) -> Self {
        let mut lower: Vec<Vec<f64>> = Vec::with_capacity(size);
        for i in 0..size {
            let mut row: Vec<f64> = Vec::with_capacity(i + 1);
            for (j, above) in lower.iter().enumerate() {
                row.push((matrix(i, j) - dot(&row, &above[..j])) / above[j]);
            }
            row.push((matrix(i, i) - dot(&row, &row)).sqrt());
            lower.push(row);
        }
        Self(lower)
    }

    /// x with L·Lᵀ·x = `right`.
    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = Vec::with_capacity(right.len());
        for (row, right) in self.0.iter().zip(right) {
            x.push((right - dot(&row[..x.len()], &x)) / row[x.len()]);
        }
        for i in (0..x.len()).rev() {
            let below: f64 = (i + 1..x.len()).map(|k| self.0[k][i] * x[k]).sum();
            x[i] = (x[i] - below) / self.0[i][i];
        }
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_and_a_constant_feature_does_no_harm() {
        let rows: Vec<Vec<f64>> = (0..400).map(|i| vec![f64::from(i) * 0.01, 7.0]).collect();
        let targets: Vec<f64> = rows.iter().map(|row| 3.0 - 2.0 * row[0]).collect();
        let line = Regression::new(&rows, &targets).unwrap();
        assert!((line.at(&[1.5, 7.0]) - 0.0).abs() < 0.01, "{}", line.at(&[1.5, 7.0]));
        assert!((line.at(&[1.5, 9.0]) - line.at(&[1.5, 7.0])).abs() < 1e-12);
        assert!(line.deviation < 0.02, "{}", line.deviation);
    }

    #[test]
    fn left_out_residuals_are_those_of_fits_without_the_row() {
        let rows: Vec<Vec<f64>> =
            (0..9).map(|i| vec![(f64::from(i) * 1.7).sin(), f64::from(i * i % 5)]).collect();
        let targets: Vec<f64> = (0..9).map(|i| (f64::from(i) * 0.9).cos()).collect();
        let squares = (0..9).map(|out| {
            let keep = |i: &usize| *i != out;
            let some: Vec<_> = (0..9).filter(keep).map(|i| rows[i].clone()).collect();
            let values: Vec<_> = (0..9).filter(keep).map(|i| targets[i]).collect();
            (Regression::new(&some, &values).unwrap().at(&rows[out]) - targets[out]).powi(2)
        });
        let honest = (squares.sum::<f64>() / 9.0).sqrt();
        let quick = Regression::new(&rows, &targets).unwrap().deviation;
        // Not alike to the digit: without the row the features are standardised anew.
        assert!((quick / honest - 1.0).abs() < 0.1, "{quick} {honest}");
    }

    #[test]
    fn too_few_rows_or_no_numbers_give_nothing() {
        assert!(Regression::new(&[], &[]).is_none());
        assert!(Regression::new(&[vec![1.0, 2.0], vec![2.0, 1.0]], &[1.0, 2.0]).is_none());
        assert!(Regression::new(&vec![vec![1.0]; 5], &[1.0, 2.0, f64::NAN, 1.0, 1.0]).is_none());
    }
}
