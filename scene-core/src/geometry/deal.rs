//! Things dealt to buckets, so that what belongs together is worked on together: in a core's cache, and bucket by bucket in parallel.

use std::ops::Range;

/// Buckets at most, so that what a chunk of some ten thousand things has of each is still some cache lines long.
pub(super) const MOST_BUCKETS: usize = 2048;

/// One chunk's things by bucket, within each in the order that they came in.
pub(super) struct Dealt<T> {
    things: Vec<T>,
    /// Where each bucket ends.
    ends: Vec<u32>,
}

impl<T: Copy + Default> Dealt<T> {
    /// Deals what `each` gives twice, the same things with the same buckets, less than 2³².
    pub(super) fn new<I: Iterator<Item = (usize, T)>>(buckets: usize, each: impl Fn() -> I) -> Self {
        // Where each bucket begins at first, and ends once all are dealt.
        let mut cursors = vec![0u32; buckets + 1];
        each().for_each(|(bucket, _)| cursors[bucket + 1] += 1);
        for bucket in 1..=buckets {
            cursors[bucket] += cursors[bucket - 1];
        }
        let mut things = vec![T::default(); cursors[buckets] as usize];
        for (bucket, thing) in each() {
            let cursor = &mut cursors[bucket];
            things[*cursor as usize] = thing;
            *cursor += 1;
        }
        cursors.truncate(buckets);
        Self { things, ends: cursors }
    }

    /// The things of a bucket.
    pub(super) fn bucket(&self, bucket: usize) -> &[T] {
        &self.things[self.range(bucket)]
    }

    /// The same, to put in another order.
    pub(super) fn bucket_mut(&mut self, bucket: usize) -> &mut [T] {
        let range = self.range(bucket);
        &mut self.things[range]
    }

    /// All things, bucket by bucket.
    pub(super) fn things(&self) -> &[T] {
        &self.things
    }

    fn range(&self, bucket: usize) -> Range<usize> {
        let begin = if bucket == 0 { 0 } else { self.ends[bucket - 1] };
        begin as usize..self.ends[bucket] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn things_keep_their_order_within_their_bucket() {
        let dealt = Dealt::new(4, || (0..10u32).map(|thing| ((thing * 7 % 3) as usize, thing)));
        let buckets: Vec<_> = (0..4).map(|bucket| dealt.bucket(bucket)).collect();
        assert_eq!(buckets, [&[0, 3, 6, 9][..], &[1, 4, 7], &[2, 5, 8], &[]]);
        let mut turned = dealt;
        turned.bucket_mut(1).reverse();
        assert_eq!(turned.things(), [0, 3, 6, 9, 7, 4, 1, 2, 5, 8]);
        assert!(Dealt::<u32>::new(1, std::iter::empty).bucket(0).is_empty());
    }
}
