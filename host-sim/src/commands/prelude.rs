//! Names that most commands use.

pub(super) use std::path::{Path, PathBuf};

pub(super) use clap::Args;
pub(super) use serde::Serialize;

pub(super) use super::choice::named;
pub(super) use super::flags::with_flags;
pub(super) use crate::error::{Error, Result, shown};
pub(super) use crate::files::output::{self, Folder, Folders, Staged};
pub(super) use crate::progress::Progress;
pub(super) use crate::{quantity, terminal};
