//! `/v1/jobs/{id}/bundle.zip` and `.tar.zst`: the whole package as one file, written while it is sent.
//!
//! The archive writers are blocking code; one blocking task per download pulls a file's blocks from the blobs, compresses them, and pushes
//! the result into a channel of a few blocks. A slow client therefore slows its own task and holds a few hundred kilobytes, whatever the
//! size of the package. Making the archive on disk first would give it a length and ranges, at the price of every package twice on disk.
//! The bytes depend on the package alone: entries in order of path, fixed times and permissions, fixed compression.

use super::{
    App, assets,
    catalogue::Kind,
    conditional::{Decision, decide, strong_etag},
    extract::JobInPath,
    problem::{Answer, Failure},
};
use crate::{blob::ByteStream, engine::Engine, records::PackageFile};
use axum::{
    body::Body,
    extract::State,
    http::{HeaderMap, HeaderValue, Method, StatusCode, header},
    response::{IntoResponse, Response},
};
use bytes::Bytes;
use futures_util::StreamExt;
use kiln_proto::{chain, ids::JobId};
use sha2::{Digest as _, Sha256};
use std::{
    fmt::Write as _,
    io::{self, BufWriter, Read, Write},
    sync::Arc,
};
use tokio::{runtime::Handle, sync::mpsc};
use tokio_stream::wrappers::ReceiverStream;

/// Bytes of a block on its way to the client.
const BLOCK: usize = 64 << 10;
/// Blocks that may wait for a slow client.
const BLOCKS: usize = 4;
/// zstd's own default.
const ZSTD_LEVEL: i32 = 3;
/// Deflate as fast as it goes: most of a package is compressed already.
const DEFLATE_LEVEL: i64 = 1;

#[derive(Debug, Clone, Copy)]
enum Format {
    Zip,
    TarZst,
}

/// The package as a ZIP archive.
#[utoipa::path(get, path = "/v1/jobs/{id}/bundle.zip", operation_id = "getZip", tag = "packages", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The archive", body = String, content_type = "application/zip")))]
pub(super) async fn zip(State(app): State<App>, JobInPath(job): JobInPath, method: Method, headers: HeaderMap) -> Answer<Response> {
    send(app, job, Format::Zip, &method, &headers).await
}

/// The package as a tar archive, compressed by zstd.
#[utoipa::path(get, path = "/v1/jobs/{id}/bundle.tar.zst", operation_id = "getTarZst", tag = "packages", params(("id" = String, Path, description = "The job's id")),
    responses((status = 200, description = "The archive", body = String, content_type = "application/zstd")))]
pub(super) async fn tar_zst(State(app): State<App>, JobInPath(job): JobInPath, method: Method, headers: HeaderMap) -> Answer<Response> {
    send(app, job, Format::TarZst, &method, &headers).await
}

async fn send(app: App, job: JobId, format: Format, method: &Method, headers: &HeaderMap) -> Answer<Response> {
    let mut files = match app.engine.package(job).await {
        Ok(files) => files,
        Err(error) => return Err(assets::explain(&app, job, error).await),
    };
    files.sort_by(|a, b| a.path.cmp(&b.path));
    let (media, extension) = match format {
        Format::Zip => ("application/zip", "zip"),
        Format::TarZst => ("application/zstd", "tar.zst"),
    };
    let etag = strong_etag(&format!("{}-{extension}", digest(&files)));
    match decide(headers, &etag, 0) {
        Decision::NotModified => return Ok((StatusCode::NOT_MODIFIED, assets::caching(&etag, assets::IMMUTABLE)?).into_response()),
        Decision::PreconditionFailed => {
            return Err(Failure::new(Kind::PreconditionFailed, format!("the archive's entity tag is {etag}")));
        }
        Decision::Whole | Decision::Part(_) | Decision::NotSatisfiable => {} // There are no ranges of a stream.
    }
    let body = if method == Method::HEAD { Body::empty() } else { stream(app.engine, job, files, format) };
    let mut response = (assets::caching(&etag, assets::IMMUTABLE)?, body).into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(media));
    headers.insert(header::CONTENT_DISPOSITION, assets::value(&format!("attachment; filename=\"kiln-{job}.{extension}\""))?);
    headers.insert(header::ACCEPT_RANGES, HeaderValue::from_static("none"));
    Ok(response)
}

/// A digest over names and contents; `files` are in order of path.
fn digest(files: &[PackageFile]) -> String {
    let mut hasher = Sha256::new();
    for file in files {
        hasher.update(file.path.as_bytes());
        hasher.update([0]);
        hasher.update(file.sha256.as_bytes());
    }
    hasher.finalize().iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // Writing to a String cannot fail.
        text
    })
}

/// The archive as a body. An error in the middle breaks the connection, so that no client takes a part for the whole.
fn stream(engine: Arc<Engine>, job: JobId, files: Vec<PackageFile>, format: Format) -> Body {
    let (sender, receiver) = mpsc::channel(BLOCKS);
    let source = Source { engine, job, runtime: Handle::current() };
    tokio::task::spawn_blocking(move || {
        let mut out = BufWriter::with_capacity(BLOCK, ChannelWriter(sender.clone()));
        let open = |file: &PackageFile| source.open(file);
        let written = match format {
            Format::Zip => write_zip(&mut out, &files, open),
            Format::TarZst => write_tar_zst(&mut out, &files, open),
        };
        if let Err(error) = written.and_then(|()| out.flush())
            && !sender.is_closed()
        {
            tracing::error!(%job, error = chain(&error), "the archive ended early");
            let _ = sender.blocking_send(Err(error)); // Whoever has gone needs no news.
        }
    });
    Body::from_stream(ReceiverStream::new(receiver))
}

/// Writes a ZIP archive of `files`.
///
/// # Errors
/// Files that cannot be read whole, a client that has gone.
fn write_zip<R: Read>(out: &mut impl Write, files: &[PackageFile], mut open: impl FnMut(&PackageFile) -> io::Result<R>) -> io::Result<()> {
    let mut archive = ::zip::ZipWriter::new_stream(out);
    for file in files {
        let options = ::zip::write::SimpleFileOptions::default()
            .compression_method(::zip::CompressionMethod::Deflated)
            .compression_level(Some(DEFLATE_LEVEL))
            .last_modified_time(::zip::DateTime::default())
            .unix_permissions(0o644)
            .large_file(file.bytes >= u64::from(u32::MAX) / 2); // Deflate may also grow what it is given.
        archive.start_file(file.path.as_str(), options)?;
        io::copy(&mut open(file)?, &mut archive)?;
    }
    archive.finish()?;
    Ok(())
}

/// Writes a tar archive of `files`, compressed by zstd.
///
/// # Errors
/// As [`write_zip`].
fn write_tar_zst<R: Read>(
    out: &mut impl Write,
    files: &[PackageFile],
    mut open: impl FnMut(&PackageFile) -> io::Result<R>,
) -> io::Result<()> {
    let mut archive = tar::Builder::new(zstd::stream::Encoder::new(out, ZSTD_LEVEL)?);
    for file in files {
        let mut entry = tar::Header::new_gnu();
        entry.set_entry_type(tar::EntryType::Regular);
        entry.set_size(file.bytes);
        entry.set_mode(0o644);
        entry.set_mtime(0);
        archive.append_data(&mut entry, &file.path, open(file)?)?;
    }
    archive.into_inner()?.finish()?;
    Ok(())
}

/// Where the files come from.
struct Source {
    engine: Arc<Engine>,
    job: JobId,
    runtime: Handle,
}

impl Source {
    fn open(&self, file: &PackageFile) -> io::Result<BlobReader> {
        let opened = self.runtime.block_on(self.engine.read_package_file(self.job, &file.path, None));
        let stream = opened.map_err(io::Error::other)?.stream;
        Ok(BlobReader { runtime: self.runtime.clone(), stream, block: Bytes::new(), left: file.bytes })
    }
}

/// A blob's stream as blocking bytes. It ends exactly where the manifest says or with an error: an archive whose entry is shorter than its
/// header would otherwise look whole.
struct BlobReader {
    runtime: Handle,
    stream: ByteStream,
    block: Bytes,
    left: u64,
}

impl Read for BlobReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.block.is_empty() {
            match self.runtime.block_on(self.stream.next()) {
                Some(block) => self.block = block.map_err(io::Error::other)?,
                None if self.left == 0 => return Ok(0),
                None => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, format!("the file ends {} bytes early", self.left))),
            }
        }
        let count = out.len().min(self.block.len());
        out[..count].copy_from_slice(&self.block.split_to(count));
        self.left = self.left.checked_sub(count as u64).ok_or_else(|| io::Error::other("the file is longer than the manifest says"))?;
        Ok(count)
    }
}

/// The sending side of the body as a writer.
struct ChannelWriter(mpsc::Sender<io::Result<Bytes>>);

impl Write for ChannelWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let sent = self.0.blocking_send(Ok(Bytes::copy_from_slice(bytes)));
        sent.map(|()| bytes.len()).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn package() -> (Vec<PackageFile>, BTreeMap<String, Vec<u8>>) {
        let long = format!("surfaces/{}/radiance.mtsp", "n".repeat(150));
        let contents = BTreeMap::from([("manifest.json".to_owned(), b"{}".to_vec()), (long, vec![7; 300_000])]);
        let file = |(path, bytes): (&String, &Vec<u8>)| PackageFile {
            path: path.clone(),
            media_type: "application/octet-stream".into(),
            bytes: bytes.len() as u64,
            sha256: "0".repeat(64),
        };
        (contents.iter().map(file).collect(), contents)
    }

    #[test]
    fn a_zip_is_deterministic_and_comes_back_whole() {
        let (files, contents) = package();
        let write = || {
            let mut out = Vec::new();
            write_zip(&mut out, &files, |file| Ok(contents[&file.path].as_slice())).unwrap();
            out
        };
        let bytes = write();
        assert_eq!(bytes, write());
        let mut archive = ::zip::ZipArchive::new(io::Cursor::new(bytes)).unwrap();
        assert_eq!(archive.len(), contents.len());
        for (path, content) in &contents {
            let mut found = Vec::new();
            archive.by_name(path).unwrap().read_to_end(&mut found).unwrap();
            assert_eq!(found, *content, "{path}");
        }
    }

    #[test]
    fn a_tar_is_deterministic_and_comes_back_whole() {
        let (files, contents) = package();
        let write = || {
            let mut out = Vec::new();
            write_tar_zst(&mut out, &files, |file| Ok(contents[&file.path].as_slice())).unwrap();
            out
        };
        let bytes = write();
        assert_eq!(bytes, write());
        let mut archive = tar::Archive::new(zstd::stream::Decoder::new(bytes.as_slice()).unwrap());
        let found: BTreeMap<String, Vec<u8>> = archive
            .entries()
            .unwrap()
            .map(|entry| {
                let (mut entry, mut content) = (entry.unwrap(), Vec::new());
                entry.read_to_end(&mut content).unwrap();
                (entry.path().unwrap().display().to_string(), content)
            })
            .collect();
        assert_eq!(found, contents);
    }

    #[test]
    fn a_blob_of_another_length_than_promised_is_an_error() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        for (left, fits) in [(2, false), (3, true), (4, false)] {
            let stream = futures_util::stream::iter([Ok(Bytes::from_static(b"ab")), Ok(Bytes::from_static(b"c"))]).boxed();
            let mut reader = BlobReader { runtime: runtime.handle().clone(), stream, block: Bytes::new(), left };
            assert_eq!(reader.read_to_end(&mut Vec::new()).is_ok(), fits, "{left}");
        }
    }
}
