//! Checks of README.md, docs, and of the words of the project.

mod tables;
mod words;
