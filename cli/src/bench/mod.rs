//! Time against error: every technique × variant × preset × backend × scene, held against cached ground truth.
//!
//! The flow: [`station`]s (scene, size, light) × [`contender`]s make cells, in an order that does not depend on the
//! machine, so that [`shard`]s of a sweep fit together. A finished cell becomes a [`record`] in `results.jsonl`, at once: an
//! interrupted run goes on where it stopped. From records alone come [`front`]s, [`table`]s, [`charts`] and the [`page`].

pub(crate) mod charts;
pub(crate) mod contender;
pub(crate) mod front;
pub(crate) mod machine;
pub(crate) mod page;
pub(crate) mod pictures;
pub(crate) mod record;
pub(crate) mod shard;
pub(crate) mod station;
pub(crate) mod table;
pub(crate) mod truth_cache;
