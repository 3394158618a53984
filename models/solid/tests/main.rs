//! The solid against tables made elsewhere, and against the laws no solid may break.

mod contact;
mod mesh;
mod rows;
mod solver;
mod table;
