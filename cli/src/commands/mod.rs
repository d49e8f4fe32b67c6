//! The commands, one file each.

pub(crate) mod audit;
pub(crate) mod bake;
pub(crate) mod bench;
pub(crate) mod compare;
pub(crate) mod recommend;
pub(crate) mod reference;
pub(crate) mod render;
pub(crate) mod scenes;
pub(crate) mod stress;
pub(crate) mod techniques;
