//! `solver reference`: the pages of the reference as files.

use base::error::Error;
use case::reference::{html, markdown};
use std::path::Path;

/// Format of the pages.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(super) enum Format {
    /// HTML with a sidebar, in light and dark; every file is complete in itself.
    Html,
    /// Markdown.
    Markdown,
}

/// Writes the pages into a folder; returns a line about them.
///
/// # Errors
/// If the folder or a file cannot be written, [`Error::Io`].
pub(super) fn write(format: Format, folder: &Path) -> Result<String, Error> {
    let files = match format {
        Format::Html => html::files(),
        Format::Markdown => markdown::files(),
    };
    let failed = |path: &Path, error| Error::Io(format!("{}: {error}", path.display()));
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    for file in &files {
        let path = folder.join(&file.name);
        std::fs::write(&path, &file.text).map_err(|error| failed(&path, error))?;
    }
    let first = files.first().map_or("", |file| &file.name);
    Ok(format!(
        "wrote {} pages; start at {}",
        files.len(),
        folder.join(first).display()
    ))
}
