//! `kiln convert`: a scene in another format. Any scene that is imported becomes glTF; X3D becomes X3D in another encoding, with the shadow
//! shortcut written out where that is asked for.
//!
//! What a format cannot say is told as a warning, so that nobody finds out by looking at the result. There is no X3D from other formats:
//! the canonical scene has lost what makes X3D worth writing (names of nodes, animations, extensions).

use crate::{
    api,
    error::CommandError,
    import_args::ImportArgs,
    output,
    submit::{self, Collected},
};
use clap::Args;
use kiln_coordinator::{
    blob::publish,
    export::gltf,
    import::{
        self, X3dEncoding,
        format::{self, Format},
    },
    records::Problem,
};
use kiln_proto::limits;
use std::{
    io::Write,
    path::{Path, PathBuf},
};

/// Write a scene in another format: glTF of any scene, X3D of X3D
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// The scene (.obj, .gltf, .glb, X3D or VRML97, or a .zip with one inside)
    input: PathBuf,
    /// What to write, by its ending: .glb, .gltf (with a .bin beside it), .x3d (XML) or .x3dv (ClassicVRML)
    output: PathBuf,
    /// Write `receiveShadows` out as shadow maps and projected texture coordinates; only from X3D to X3D
    #[arg(long)]
    lower_shadows: bool,
    /// Replace files that are there
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    import: ImportArgs,
}

/// What is to be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Target {
    Glb,
    Gltf,
    X3d(X3dEncoding),
}

/// What came of it.
struct Converted {
    files: Vec<(PathBuf, Vec<u8>)>,
    warnings: Vec<Problem>,
    /// More to report, as JSON.
    facts: serde_json::Value,
}

/// Converts, writes and reports.
pub fn run(args: &ConvertArgs, json: bool) -> Result<(), CommandError> {
    let target = target(&args.output, args.lower_shadows)?;
    refuse_to_overwrite(args, target)?;
    refuse_what_says_nothing(args, target)?;
    let scratch = submit::scratch()?;
    let scene = submit::collect(&args.input, &args.import, scratch.path())?;
    let converted = match target {
        Target::X3d(encoding) => x3d(args, &scene, encoding)?,
        Target::Glb | Target::Gltf => gltf(args, &scene, target)?,
    };
    for (path, bytes) in &converted.files {
        write(path, bytes)?;
    }
    for warning in &converted.warnings {
        eprintln!("warning: {warning}");
    }
    report(&converted, json)
}

/// What the name of the output asks for.
fn target(output: &Path, lower_shadows: bool) -> Result<Target, CommandError> {
    let target = match format::extension(&output.to_string_lossy()).as_str() {
        "glb" => Target::Glb,
        "gltf" => Target::Gltf,
        "x3d" => Target::X3d(X3dEncoding::Xml),
        "x3dv" => Target::X3d(X3dEncoding::Classic),
        _ => {
            let message = "the ending of the output must be .glb, .gltf, .x3d or .x3dv: it says what to write";
            return Err(CommandError::usage(format!("{}: {message}", output.display())));
        }
    };
    if lower_shadows && !matches!(target, Target::X3d(_)) {
        let message = "--lower-shadows writes X3D; give the output the ending .x3d or .x3dv";
        return Err(CommandError::usage(format!("{}: {message}", output.display())));
    }
    Ok(target)
}

/// The files that a target writes.
fn files(output: &Path, target: Target) -> Vec<PathBuf> {
    let mut files = vec![output.to_owned()];
    files.extend((target == Target::Gltf).then(|| output.with_extension("bin")));
    files
}

fn refuse_to_overwrite(args: &ConvertArgs, target: Target) -> Result<(), CommandError> {
    let same = |path: &Path| matches!((path.canonicalize(), args.input.canonicalize()), (Ok(a), Ok(b)) if a == b);
    for path in files(&args.output, target) {
        if same(&path) {
            return Err(CommandError::usage(format!("{}: this is the input; name another file for the output", path.display())));
        }
        if path.exists() && (!args.force || path.is_dir()) {
            let advice = if path.is_dir() { "this is a folder; name a file" } else { "the file exists; name another or say --force" };
            return Err(CommandError::usage(format!("{}: {advice}", path.display())));
        }
    }
    Ok(())
}

/// X3D is written as its author has it: options about what a bake makes of it would do nothing there.
fn refuse_what_says_nothing(args: &ConvertArgs, target: Target) -> Result<(), CommandError> {
    let given = args.import.of_the_scene();
    if given.is_empty() || !matches!(target, Target::X3d(_)) {
        return Ok(());
    }
    let message = "X3D is written as its author has it; leave these options to the bake, or give the output the ending .glb or .gltf";
    Err(CommandError::usage(format!("{}: {message}", given.join(", "))))
}

fn gltf(args: &ConvertArgs, scene: &Collected, target: Target) -> Result<Converted, CommandError> {
    let imported = import::import_bundle(&scene.bundle, &scene.options).map_err(|p| api::rejected(&p))?;
    let failed = |e: gltf::ExportError| CommandError::from_error(args.output.display(), &e);
    let mut exported = gltf::export(&imported.scene).map_err(failed)?;
    let mut warnings = imported.warnings;
    warnings.append(&mut exported.warnings);
    let paths = files(&args.output, target);
    let contents = if target == Target::Glb {
        vec![exported.glb().map_err(failed)?]
    } else {
        let name = paths[1].file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (text, binary) = exported.gltf(&name).map_err(failed)?;
        vec![text, binary]
    };
    let statistics = &imported.statistics;
    let facts = serde_json::json!({ "triangles": statistics.triangles, "surfaces": statistics.surfaces.len(), "materials": statistics.materials,
        "textures": statistics.textures });
    // The binary file first: a text that names it is whole when it appears.
    let files = paths.into_iter().zip(contents).rev().collect();
    Ok(Converted { files, warnings, facts })
}

fn x3d(args: &ConvertArgs, scene: &Collected, encoding: X3dEncoding) -> Result<Converted, CommandError> {
    let main = scene.bundle.main();
    let bytes = scene.bundle.read(main, limits::TEXT_BYTES).map_err(|p| CommandError::work(p.to_string()))?;
    if format::detect(main.as_str(), &bytes) != Format::X3d {
        let message = "this is not X3D, and X3D is written of X3D only; give the output the ending .glb or .gltf";
        return Err(CommandError::usage(format!("{}: {message}", args.input.display())));
    }
    let mut rewritten =
        import::rewrite_x3d(&scene.bundle, scene.options.time, args.lower_shadows, encoding).map_err(|p| api::rejected(&p))?;
    let folder = |path: &Path| path.parent().map(Path::to_owned).unwrap_or_default();
    if let (Some(first), true) = (rewritten.files.first(), folder(&args.input) != folder(&args.output)) {
        let message =
            format!("it refers to {} files (the first is {first}), which were not copied: put them beside it", rewritten.files.len());
        rewritten.warnings.push(Problem { message, file: Some(args.output.display().to_string()), line: None });
    }
    let facts = serde_json::json!({ "lowered_appearances": rewritten.lowered, "refers_to": rewritten.files });
    Ok(Converted { files: vec![(args.output.clone(), rewritten.text.into_bytes())], warnings: rewritten.warnings, facts })
}

/// Writes a file whole or not at all.
fn write(path: &Path, bytes: &[u8]) -> Result<(), CommandError> {
    let failed = |e: std::io::Error| CommandError::from_error(format!("{} cannot be written", path.display()), &e);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(failed)?;
    let mut staged = tempfile::Builder::new().prefix(".kiln-convert-").tempfile_in(folder).map_err(failed)?;
    staged.write_all(bytes).map_err(failed)?;
    publish(staged.into_temp_path(), path).map_err(failed)
}

fn report(converted: &Converted, json: bool) -> Result<(), CommandError> {
    if json {
        let files: Vec<_> = converted.files.iter().map(|(path, bytes)| serde_json::json!({ "path": path, "bytes": bytes.len() })).collect();
        let mut report = serde_json::json!({ "files": files, "warnings": converted.warnings });
        if let (Some(report), Some(facts)) = (report.as_object_mut(), converted.facts.as_object()) {
            report.extend(facts.clone());
        }
        return output::json(&report);
    }
    converted.files.iter().try_for_each(|(path, bytes)| output::line(&format!("{}: {} bytes", path.display(), bytes.len())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_that_x3d_has_no_use_for_are_refused() {
        #[derive(clap::Parser)]
        struct Command {
            #[command(flatten)]
            args: ConvertArgs,
        }
        let refused = |words: &[&str], target| {
            let args = <Command as clap::Parser>::parse_from(["convert", "a.wrl", "b"].iter().chain(words)).args;
            refuse_what_says_nothing(&args, target).map_err(|e| (e.exit_code(), e.to_string()))
        };
        let x3d = Target::X3d(X3dEncoding::Xml);
        assert_eq!(refused(&["--time", "2", "--lower-shadows"], x3d), Ok(()));
        let given = ["--environment", "sky.hdr", "--x3d-shadows", "strict"];
        let (code, message) = refused(&given, x3d).unwrap_err();
        assert!(code == 2 && message.starts_with("--environment, --x3d-shadows: X3D is written"), "{message}");
        assert_eq!(refused(&given, Target::Glb), Ok(()));
    }

    #[test]
    fn the_ending_says_what_to_write() {
        let of = |name: &str, lower| target(Path::new(name), lower).map_err(|e| (e.exit_code(), e.to_string()));
        assert_eq!(of("a.GLB", false).unwrap(), Target::Glb);
        assert_eq!(of("d.x/a.x3dv", true).unwrap(), Target::X3d(X3dEncoding::Classic));
        assert_eq!(
            of("a.gltf", true).unwrap_err(),
            (2, "a.gltf: --lower-shadows writes X3D; give the output the ending .x3d or .x3dv".into())
        );
        assert_eq!(of("a.obj", false).unwrap_err().0, 2);
        assert_eq!(files(Path::new("d/a.gltf"), Target::Gltf), [PathBuf::from("d/a.gltf"), PathBuf::from("d/a.bin")]);
    }
}
