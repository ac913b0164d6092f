//! Which files a package has, which it must have, and whether each is the one that the manifest lists.

use crate::package::{Package, ToolError, io_fault};
use kiln_proto::{
    format::{
        FileRecord, Kind, Sha256Hex, container, header,
        manifest::{PATH, REPORT_PATH},
    },
    scene::Surface,
};
use sha2::{Digest as _, Sha256};
use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::Read,
    path::Path,
};

/// Bytes read at once when a file is hashed.
const BLOCK: u64 = 1 << 18;

/// The files that a surface must have, and no other.
pub(super) fn required<'a>(package: &Package, surface: &'a Surface) -> impl Iterator<Item = String> + 'a {
    let raw = package.plan.settings.raw.is_some();
    Kind::ALL.into_iter().filter(move |kind| raw || *kind != Kind::Mtex).map(|kind| kind.path(&surface.file_stem))
}

/// What is wrong with the manifest's list: files that every such package has and it leaves out, files that no such package has, and an
/// order that it does not promise.
pub(super) fn list_faults(package: &Package) -> Vec<String> {
    let surfaces = package.scene.surfaces.iter().flat_map(|s| required(package, s));
    let needed: BTreeSet<String> = surfaces.chain([container::PATH.to_owned()]).collect();
    let listed: Vec<&str> = package.manifest.files.iter().map(|f| f.path.as_str()).collect();
    let missing = needed.iter().filter(|path| !listed.contains(&path.as_str())).map(|path| format!("the manifest does not list {path}"));
    let alien = listed.iter().filter(|path| !needed.contains(**path)).map(|path| format!("{path}: no file of this package's surfaces"));
    let order = listed.windows(2).filter(|w| w[0] >= w[1]).map(|w| format!("the manifest lists {} after {}", w[1], w[0]));
    missing.chain(alien).chain(order).collect()
}

/// Files in the folder that the manifest does not list: no hash covers them.
pub(super) fn unlisted(package: &Package) -> Result<Vec<String>, ToolError> {
    let mut found = BTreeSet::new();
    walk(&package.dir, "", &mut found)?;
    let known: BTreeSet<&str> = package.manifest.files.iter().map(|f| f.path.as_str()).chain([PATH, REPORT_PATH]).collect();
    let extra = found.iter().filter(|path| !known.contains(path.as_str()));
    Ok(extra.map(|path| format!("{path}: in the folder, but not in the manifest")).collect())
}

/// Collects the paths of all that is no folder. Links are not followed: a package has none.
fn walk(folder: &Path, prefix: &str, found: &mut BTreeSet<String>) -> Result<(), ToolError> {
    for entry in fs::read_dir(folder).map_err(io_fault(folder))? {
        let entry = entry.map_err(io_fault(folder))?;
        let path = format!("{prefix}{}", entry.file_name().to_string_lossy());
        if entry.file_type().map_err(io_fault(&entry.path()))?.is_dir() {
            walk(&entry.path(), &format!("{path}/"), found)?;
        } else {
            found.insert(path);
        }
    }
    Ok(())
}

/// The file as it is, and what is wrong with its checksum where it has one.
pub(super) fn hash_file(package: &Package, claim: &FileRecord) -> Result<(FileRecord, Option<String>), ToolError> {
    let path = package.dir.join(&claim.path);
    let mut file = File::open(&path).map_err(io_fault(&path))?;
    // `read_to_end` of a part fills it whatever the sizes of single reads; only the end of the file makes it shorter.
    let mut part = |most: u64| {
        let mut block = vec![];
        file.by_ref().take(most).read_to_end(&mut block).map(|_| block).map_err(io_fault(&path))
    };
    let head = part(header::BYTES as u64)?;
    let (mut hash, mut crc, mut bytes) = (Sha256::new_with_prefix(&head), 0, head.len() as u64);
    loop {
        let block = part(BLOCK)?;
        if block.is_empty() {
            break;
        }
        hash.update(&block);
        crc = crc32c::crc32c_append(crc, &block);
        bytes += block.len() as u64;
    }
    // A file under a header is damaged anyway, and fails by its hash.
    let claimed = head.last_chunk().copied().map_or(0, u32::from_le_bytes);
    let fault = (claim.path.starts_with("surfaces/") && claimed != crc)
        .then(|| format!("{}: its header's checksum is {claimed:08x}; the payload gives {crc:08x}", claim.path));
    Ok((FileRecord { bytes, sha256: Sha256Hex(hash.finalize().into()), ..claim.clone() }, fault))
}
