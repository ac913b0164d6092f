//! What tests and benches share: scenes built in code, a loader for the project's own OBJ scenes, plans of them.
//!
//! The loader reads just what `tests/scenes` holds (`o`, `v`, `vt`, `f` with triangles, `usemtl`, `Kd Ks Ns Ke`); the real importer lives
//! in the coordinator, which the worker must not know.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::missing_panics_doc)]

use kiln_proto::{
    BAKE_VERSION,
    frame::FrameRule,
    ids::SceneHash,
    plan::{ChartSource, PLAN_VERSION, Plan, PlannedTile, SurfacePlan},
    scene::{Lobe, Material, MetallicRoughness, Phong, Reflection, Scene, Surface, Triangle},
    settings::{BakeSettings, SettingsPatch, TextureSize},
    texel::SurfaceRaster,
    tile::Cell,
    units::Rgb,
};
use std::{collections::BTreeMap, path::PathBuf};

/// A file of the project's `tests` folder.
pub(crate) fn test_file(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests").join(name)
}

/// A table of a reference: comma-separated, with a line of names.
pub(crate) struct Table {
    names: Vec<String>,
    lines: Vec<Vec<String>>,
}

/// A line of a [`Table`].
pub(crate) struct Line<'a>(&'a Table, usize);

impl Table {
    /// Reads a file of the project's `tests` folder.
    pub(crate) fn read(name: &str) -> Self {
        let text = std::fs::read_to_string(test_file(name)).unwrap();
        let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<String>>());
        Self { names: lines.next().unwrap(), lines: lines.collect() }
    }

    /// Its lines in order.
    pub(crate) fn rows(&self) -> impl Iterator<Item = Line<'_>> {
        (0..self.lines.len()).map(|k| Line(self, k))
    }
}

impl Line<'_> {
    /// A cell as it is.
    pub(crate) fn text(&self, column: &str) -> &str {
        let at = self.0.names.iter().position(|n| n == column).unwrap();
        &self.0.lines[self.1][at]
    }

    /// A cell as a number.
    pub(crate) fn number(&self, column: &str) -> f32 {
        self.text(column).parse().unwrap()
    }

    /// Three cells: `NAME_x`, `NAME_y`, `NAME_z`, or with r, g, b.
    pub(crate) fn vector(&self, name: &str) -> glam::Vec3 {
        let letters = if self.0.names.iter().any(|n| *n == format!("{name}_x")) { ["x", "y", "z"] } else { ["r", "g", "b"] };
        glam::Vec3::from_array(letters.map(|l| self.number(&format!("{name}_{l}"))))
    }
}

/// Processor seconds that this thread has used (wall time is worth little on a shared machine), or wall time where the system does not say.
pub(crate) fn thread_seconds() -> f64 {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    let scheduled = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = scheduled.and_then(|s| s.split(' ').next().and_then(|n| n.parse::<f64>().ok()));
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |n| n * 1e-9)
}

/// A diffuse material.
pub(crate) fn lambert(kd: f32, ke: f32) -> Material {
    Material::matt("m", Rgb::splat(kd)).emitting(Rgb::splat(ke))
}

/// A glossy material.
pub(crate) fn phong(kd: f32, ks: f32, exponent: f32) -> Material {
    specular(kd, ks, Lobe::Phong { exponent })
}

/// A mirror over a diffuse base.
pub(crate) fn mirror(kd: f32, ks: f32, ke: f32) -> Material {
    specular(kd, ks, Lobe::Mirror).emitting(Rgb::splat(ke))
}

/// A material of glTF's appendix B.
pub(crate) fn appendix_b(base: [f32; 3], metallic: f32, roughness: f32) -> MetallicRoughness {
    MetallicRoughness::plain(Rgb::from(base), metallic, roughness)
}

/// A material that reflects so.
pub(crate) fn rough(m: MetallicRoughness) -> Material {
    Material::new("m", Reflection::MetallicRoughness(m))
}

fn specular(kd: f32, ks: f32, lobe: Lobe) -> Material {
    Material::new("m", Reflection::Phong(Phong { specular: Rgb::splat(ks), lobe, ..Phong::matt(Rgb::splat(kd)) }))
}

/// An empty scene.
pub(crate) fn empty() -> Scene {
    Scene::empty()
}

/// Adds a parallelogram as a surface of its own; its front is where `u x v` points, its texture coordinates are the unit square.
pub(crate) fn add_quad(scene: &mut Scene, name: &str, corner: [f32; 3], u: [f32; 3], v: [f32; 3], material: Material) {
    let at = |a: f32, b: f32| std::array::from_fn(|k| corner[k] + a * u[k] + b * v[k]);
    let first = scene.positions.len() as u32;
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    scene.positions.extend(square.map(|[a, b]| -> [f32; 3] { at(a, b) }));
    let triangle =
        |c: [u32; 3]| (Triangle { corners: c.map(|k| first + k), polygon: 0 }, Some(c.map(|k| square[k as usize].map(|x: f32| x))));
    let surface = Surface::plain(name, scene.materials.len() as u32, vec![triangle([0, 1, 2]), triangle([0, 2, 3])]);
    scene.materials.push(material);
    scene.surfaces.push(surface);
}

/// A unit cube seen from inside, scaled: `wall0` .. `wall5`, all of one material. `wall0` is the floor.
pub(crate) fn closed_box(size: f32, material: &Material) -> Scene {
    let mut scene = empty();
    let s = size;
    let walls = [
        ([0.0, 0.0, s], [s, 0.0, 0.0], [0.0, 0.0, -s]),
        ([0.0, s, 0.0], [s, 0.0, 0.0], [0.0, 0.0, s]),
        ([0.0, 0.0, 0.0], [s, 0.0, 0.0], [0.0, s, 0.0]),
        ([s, 0.0, s], [-s, 0.0, 0.0], [0.0, s, 0.0]),
        ([0.0, 0.0, s], [0.0, 0.0, -s], [0.0, s, 0.0]),
        ([s, 0.0, 0.0], [0.0, 0.0, s], [0.0, s, 0.0]),
    ];
    for (k, (corner, u, v)) in walls.into_iter().enumerate() {
        add_quad(&mut scene, &format!("wall{k}"), corner, u, v, material.clone());
    }
    scene
}

/// A scene with every coordinate multiplied.
pub(crate) fn scaled(mut scene: Scene, factor: f32) -> Scene {
    scene.positions.iter_mut().flatten().for_each(|v| *v *= factor);
    scene
}

/// Settings by field.
pub(crate) fn settings(json: &str) -> BakeSettings {
    serde_json::from_str::<SettingsPatch>(json).unwrap().resolve().unwrap()
}

/// Loads a scene of `tests/scenes`.
pub(crate) fn load(name: &str) -> Scene {
    let path = test_file(&format!("scenes/{name}-room/{name}"));
    let read = |extension: &str| std::fs::read_to_string(path.with_extension(extension)).unwrap();
    let mut scene = empty();
    let materials = load_materials(&read("mtl"), &mut scene);
    let mut uv: Vec<[f32; 2]> = vec![];
    for line in read("obj").lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |k: usize| words[k].parse::<f32>().unwrap();
        match words.first().copied() {
            Some("v") => scene.positions.push([number(1), number(2), number(3)]),
            Some("vt") => uv.push([number(1), number(2)]),
            Some("o") => {
                let name = words[1].to_owned();
                scene.surfaces.push(Surface { uv_sets: vec![vec![]], ..Surface::plain(name, 0, vec![]) });
            }
            Some("usemtl") => scene.surfaces.last_mut().unwrap().parts[0].material = materials[words[1]],
            Some("f") => {
                let corner = |k: usize| words[k].split('/').map(|i| i.parse::<u32>().unwrap() - 1).collect::<Vec<u32>>();
                let c = [corner(1), corner(2), corner(3)];
                let surface = scene.surfaces.last_mut().unwrap();
                let polygon = surface.triangles.len() as u32 / 2;
                surface.uv_sets[0].push(Some(std::array::from_fn(|k| uv[c[k][1] as usize])));
                surface.triangles.push(Triangle { corners: std::array::from_fn(|k| c[k][0]), polygon });
                surface.parts[0].triangles += 1;
            }
            _ => {}
        }
    }
    scene
}

fn load_materials(text: &str, scene: &mut Scene) -> BTreeMap<String, u32> {
    let mut names = BTreeMap::new();
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let colour = || Rgb::from(std::array::from_fn(|k| words[k + 1].parse::<f32>().unwrap()));
        match words.first().copied() {
            Some("newmtl") => {
                names.insert(words[1].to_owned(), scene.materials.len() as u32);
                scene.materials.push(Material::matt(words[1], Rgb::BLACK));
            }
            Some("Kd") => last_phong(scene).diffuse = colour(),
            Some("Ks") => last_phong(scene).specular = colour(),
            Some("Ke") => scene.materials.last_mut().unwrap().emission = colour(),
            Some("Ns") => last_phong(scene).lobe = Lobe::Phong { exponent: words[1].parse().unwrap() },
            _ => {}
        }
    }
    names
}

fn last_phong(scene: &mut Scene) -> &mut Phong {
    match &mut scene.materials.last_mut().unwrap().reflection {
        Reflection::Phong(phong) => phong,
        other => panic!("{other:?}"),
    }
}

/// A plan in the author's texture coordinates: sizes from `settings.texture_sizes`, 8x8 where they say nothing, times `texel_scale`.
pub(crate) fn plan(scene: &Scene, settings: &BakeSettings) -> Plan {
    let layout = |surface: &Surface| {
        let given = settings.texture_sizes.get(&surface.name).copied().unwrap_or(TextureSize { width: 8, height: 8 });
        let scale = |n: u32| ((n as f32 * settings.texel_scale).round() as u32).max(1);
        let uv = surface.uv_sets[0].iter().map(|uv| uv.unwrap()).collect();
        let charts = surface.triangles.iter().map(|t| t.polygon).collect();
        let size = TextureSize { width: scale(given.width), height: scale(given.height) };
        let mut plan = SurfacePlan { size, source: ChartSource::Author, uv, charts, covered: 0, tiles: vec![] };
        let raster = SurfaceRaster::new(scene, surface, &plan, FrameRule::Texture);
        let cells = (0..raster.rows()).flat_map(|y| (0..raster.columns()).map(move |x| Cell { x: x as u16, y: y as u16 }));
        let tile = |cell: Cell| {
            let rows = raster.tile(cell);
            let covered = rows.iter().filter(|r| r.is_covered()).count();
            PlannedTile { cell, covered: covered as u16, gutter: (rows.len() - covered) as u16 }
        };
        plan.tiles = cells.map(tile).filter(|t| t.covered + t.gutter > 0).collect();
        plan.tiles.sort_by_key(|t| t.cell.morton());
        plan.covered = plan.tiles.iter().map(|t| u64::from(t.covered)).sum();
        plan
    };
    let surfaces = scene.surfaces.iter().map(layout).collect();
    let scene = SceneHash::of(&scene.to_bytes().unwrap());
    Plan { version: PLAN_VERSION, bake_version: BAKE_VERSION, scene, settings: settings.clone(), surfaces, probe: None }
}

/// Adds the back of a surface, of another material.
pub(crate) fn add_back(scene: &mut Scene, front: usize, material: Material) {
    let mut back = scene.surfaces[front].clone();
    back.name = format!("{}~back", back.name);
    back.file_stem = back.name.clone();
    back.back_of = Some(front as u32);
    let turn = |c: &mut [u32; 3]| c.swap(1, 2);
    back.triangles.iter_mut().for_each(|t| turn(&mut t.corners));
    back.uv_sets.iter_mut().flatten().flatten().for_each(|c| c.swap(1, 2));
    back.colors.iter_mut().for_each(turn);
    let mirrored: Vec<[f32; 4]> = scene.tangents.iter().map(|[x, y, z, side]| [*x, *y, *z, -side]).collect();
    let firsts = [scene.normals.len() as u32, scene.tangents.len() as u32];
    scene.tangents.extend(mirrored);
    back.tangents.iter_mut().for_each(|c| *c = [c[0], c[2], c[1]].map(|k| k + firsts[1]));
    let reversed: Vec<[f32; 3]> = scene.normals.iter().map(|n| n.map(|v| -v)).collect();
    if !back.normals.is_empty() {
        scene.normals.extend(reversed);
        back.normals.iter_mut().for_each(|c| *c = [c[0], c[2], c[1]].map(|k| k + firsts[0]));
    }
    back.parts[0].material = scene.materials.len() as u32;
    scene.materials.push(material);
    scene.surfaces.push(back);
}
