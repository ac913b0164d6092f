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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(feature = "page")]
    fn the_viewer_is_written_with_what_it_loads() {
        let dir = tempfile::tempdir().unwrap();
        write(dir.path()).unwrap();
        let page = std::fs::read(dir.path().join("index.html")).unwrap();
        assert_eq!(page, &*page::file("viewer.html").unwrap().bytes);
        for (path, file) in page::viewer() {
            assert_eq!(std::fs::read(dir.path().join(path)).unwrap(), &*file.bytes, "{path}");
        }
    }

    #[test]
    #[cfg(not(feature = "page"))]
    fn a_build_without_the_page_refuses_to_export_it() {
        let dir = tempfile::tempdir().unwrap();
        assert!(write(dir.path()).unwrap_err().to_string().contains("no viewer"));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
