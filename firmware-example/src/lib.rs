//! Parts of the firmware: the board, and what runs on any.
#![no_std]

pub mod board;
pub mod console;
pub mod navigation;
pub mod service;
