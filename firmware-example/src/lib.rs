//! Parts of the firmware: the board, and board-independent code.
#![no_std]

pub mod board;
pub mod console;
pub mod navigation;
pub mod service;
