//! A scene on its way in: multipart with several files, or one body; each file goes to the spool as it comes and is never held in memory.

use super::{
    body::{self, Budget, Interrupted},
    catalogue::Kind,
    extract::{JSON_BYTES, media_type},
    problem::{Answer, Failure},
};
use crate::{
    engine::{Engine, UploadedFile},
    import::bundle::Paths,
};
use axum::{
    extract::{FromRequest, Multipart, Request, multipart::Field},
    http::{HeaderMap, header},
};
use futures_util::TryStreamExt;
use kiln_proto::{ids::Digest, limits};
use tempfile::TempPath;

/// Media types of a single body that are a scene whatever its name.
const SCENE_MEDIA: &[&str] = &[
    "application/octet-stream",
    "application/x-www-form-urlencoded", // What curl says of `--data-binary` unless told otherwise.
    "application/zip",
    "application/x-zip-compressed",
    "model/obj",
    "text/plain",
];

/// An upload that has arrived whole. Its files are removed when it is dropped before the engine has taken them.
#[derive(Debug)]
pub(super) struct Upload {
    files: Vec<(String, TempPath)>,
    /// Hash of the names and contents of all parts, in order.
    pub contents: Digest,
    /// The JSON of the part `settings`, where there is one.
    pub settings: Option<Vec<u8>>,
}

impl Upload {
    /// Reads the body of `request`. `name` is the client's name for a single body.
    ///
    /// # Errors
    /// A body that is cut, stalls, is too large, has no file with content, or names files outside its folder; a full disk.
    pub(super) async fn receive(engine: &Engine, request: Request, name: Option<&str>) -> Answer<Self> {
        body::within(request.body(), limits::BUNDLE_BYTES + JSON_BYTES)?;
        if media_type(request.headers()).is_some_and(|media| media.starts_with("multipart/")) {
            Self::parts(engine, request).await
        } else {
            Self::single(engine, request, name).await
        }
    }

    /// Hands the files to `take`, which moves them; whatever it leaves is removed.
    pub(super) async fn give<T, F: Future<Output = T>>(self, take: impl FnOnce(Vec<UploadedFile>) -> F) -> T {
        let files = self.files.iter().map(|(name, path)| UploadedFile { name: name.clone(), path: path.to_path_buf() }).collect();
        take(files).await
    }

    async fn single(engine: &Engine, request: Request, name: Option<&str>) -> Answer<Self> {
        let media = media_type(request.headers());
        let name = name.map(str::to_owned).or_else(|| disposition_name(request.headers()));
        if name.is_none() && !media.as_deref().is_none_or(|media| SCENE_MEDIA.contains(&media)) {
            let found = media.unwrap_or_default();
            let takes =
                "multipart/form-data, or one file as application/zip, model/obj or application/octet-stream, or any type with ?name=";
            return Err(Failure::new(Kind::UnsupportedMediaType, format!("Content-Type says {found}; this call takes {takes}")));
        }
        name.as_deref().map_or(Ok(()), |name| take_name(&mut Paths::default(), name))?;
        let mut contents = Contents::default();
        let mut content = blake3::Hasher::new();
        let mut stream = request.into_body().into_data_stream().inspect_ok(|bytes| {
            content.update(bytes);
        });
        let spooled = body::spool(engine, &mut stream, &mut Budget::new(limits::BUNDLE_BYTES)).await?;
        drop(stream);
        contents.add(name.as_deref().unwrap_or_default(), &content);
        some_content(spooled.length, name.as_deref().into_iter())?;
        let name = name.unwrap_or_else(|| if spooled.zipped { "scene.zip" } else { "scene.obj" }.to_owned());
        Ok(Self { files: vec![(name, spooled.path)], contents: contents.digest(), settings: None })
    }

    async fn parts(engine: &Engine, request: Request) -> Answer<Self> {
        let mut parts = Multipart::from_request(request, &()).await.map_err(|rejection| {
            Failure::new(Kind::InvalidRequest, format!("the multipart body cannot be read: {}", rejection.body_text()))
        })?;
        let (mut files, mut settings, mut total) = (Vec::new(), None, 0);
        let (mut names, mut budget, mut contents) = (Paths::default(), Budget::new(limits::BUNDLE_BYTES), Contents::default());
        while let Some(mut field) = parts.next_field().await.map_err(|error| Interrupted::from(error).0)? {
            // `curl -F settings=@file.json` sends a filename, `-F 'settings={…}'` none: the part's name decides.
            let name = match field.file_name() {
                Some(name) if field.name() != Some("settings") => name.to_owned(),
                _ => {
                    let json = settings_part(field, settings.is_some()).await?;
                    contents.add("", blake3::Hasher::new().update(&json));
                    settings = Some(json);
                    continue;
                }
            };
            take_name(&mut names, &name)?;
            if files.len() == limits::BUNDLE_FILES {
                return Err(Failure::new(Kind::TooLarge, format!("more than {} files in one upload", limits::BUNDLE_FILES)));
            }
            let mut content = blake3::Hasher::new();
            let mut stream = (&mut field).inspect_ok(|bytes| {
                content.update(bytes);
            });
            let spooled = body::spool(engine, &mut stream, &mut budget).await?;
            contents.add(&name, &content);
            total += spooled.length;
            files.push((name, spooled.path));
        }
        some_content(total, files.iter().map(|(name, _)| name.as_str()))?;
        Ok(Self { files, contents: contents.digest(), settings })
    }
}

/// A hash over parts: their names and contents, whatever stands between them.
#[derive(Default)]
struct Contents(blake3::Hasher);

impl Contents {
    /// Adds a part; the settings have no name.
    fn add(&mut self, name: &str, content: &blake3::Hasher) {
        self.0.update(&(name.len() as u64).to_le_bytes()).update(name.as_bytes()).update(content.finalize().as_bytes());
    }

    fn digest(&self) -> Digest {
        Digest(*self.0.finalize().as_bytes())
    }
}

/// A part without a filename: only `settings` is known.
async fn settings_part(mut field: Field<'_>, again: bool) -> Answer<Vec<u8>> {
    let name = field.name().unwrap_or_default().to_owned();
    if name != "settings" {
        let detail = format!("the part `{}` has no filename, and only `settings` may go without one", name.escape_debug());
        return Err(Failure::new(Kind::InvalidRequest, detail).field(name));
    }
    if again {
        return Err(Failure::new(Kind::InvalidRequest, "the part `settings` comes twice").field(name));
    }
    body::collect(&mut field, JSON_BYTES).await
}

fn some_content<'a>(bytes: u64, names: impl Iterator<Item = &'a str>) -> Answer<()> {
    if bytes > 0 {
        return Ok(());
    }
    let names: Vec<String> = names.map(|n| n.escape_debug().to_string()).collect();
    let detail = match names.as_slice() {
        [] => "the upload has no file".to_owned(),
        _ => format!("the upload has no file with content: {}", names.join(", ")),
    };
    Err(Failure::new(Kind::EmptyUpload, detail))
}

/// The `filename` of Content-Disposition. The extended form (`filename*`) is not read: `?name=` takes any text.
fn disposition_name(headers: &HeaderMap) -> Option<String> {
    let value = headers.get(header::CONTENT_DISPOSITION)?.to_str().ok()?;
    let name = value.split(';').find_map(|part| part.trim().strip_prefix("filename="))?;
    Some(name.trim_matches('"').to_owned())
}

/// Refuses a name that leaves the scene's folder or that another file has, before its bytes come: the rule is that of bundles.
fn take_name(names: &mut Paths, name: &str) -> Answer<()> {
    let Err(bad) = names.take(name) else { return Ok(()) };
    let shown: String = name.chars().take(80).flat_map(char::escape_debug).collect();
    Err(Failure::new(Kind::BadFileName, format!("the file name `{shown}`: {bad}")).file(shown))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_leave_the_folder_are_refused() {
        for bad in ["", "/etc/passwd", "../x.obj", "a/../../x", "a\\..\\..\\x", "C:/x", "a\0b", "a\nb", "./", &"n".repeat(2_000)] {
            assert_eq!(take_name(&mut Paths::default(), bad).unwrap_err().kind(), Kind::BadFileName, "{bad:?}");
        }
        let mut names = Paths::default();
        for good in ["scene.obj", "textures/wood grain.png", "textures\\brick.png", "..a", "tür.obj"] {
            assert!(take_name(&mut names, good).is_ok(), "{good}");
        }
        assert_eq!(take_name(&mut names, "Scene.OBJ").unwrap_err().kind(), Kind::BadFileName);
    }

    #[test]
    fn a_disposition_may_name_the_body() {
        let named = |value: &str| disposition_name(&[(header::CONTENT_DISPOSITION, value.parse().unwrap())].into_iter().collect());
        assert_eq!(named("attachment; filename=\"room.obj\"").as_deref(), Some("room.obj"));
        assert_eq!(named("attachment; filename=room.zip").as_deref(), Some("room.zip"));
        assert_eq!(named("inline"), None);
    }
}
