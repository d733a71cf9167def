//! The source tree, its pages and scripts.

mod expect;
mod features;
mod layers;
mod pages;
