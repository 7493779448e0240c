//! Files as they are read and written.

mod lab_files;
mod other_files;
mod refused_recordings;
