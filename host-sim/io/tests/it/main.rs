//! Files as they are read and written.

mod damaged_files;
mod instruments;
mod lab_files;
mod misreadings;
mod other_files;
mod refused_recordings;
mod written_files;
