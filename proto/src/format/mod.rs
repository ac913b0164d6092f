//! Files of a package: headers, manifest, readers.
