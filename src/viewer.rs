//! The viewer beside a package: what `--with-viewer` writes, so that any web server can show a bake from a folder.

use crate::error::CommandError;
use kiln_coordinator::page;
use std::path::Path;

/// Refuses where the binary was built without the page.
pub fn require() -> Result<(), CommandError> {
    if page::viewer().is_empty() {
        return Err(CommandError::usage(
            "this build of kiln has no viewer in it; build it with the feature `page`, which is on by default",
        ));
    }
    Ok(())
}

/// Writes the viewer's page as `index.html`, with what it loads and the library, into `dir`. The page looks for `package/manifest.json`.
pub fn write(dir: &Path) -> Result<(), CommandError> {
    require()?;
    for (path, file) in page::viewer() {
        let to = dir.join(path);
        let written = to.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(&to, &file.bytes));
        written.map_err(|e| CommandError::work(format!("{}: {e}", to.display())))?;
    }
    Ok(())
}
