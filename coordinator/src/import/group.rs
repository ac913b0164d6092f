//! Many small surfaces share one texture: a tree of a thousand leaves is one surface of a thousand parts.
//!
//! A surface costs files, an atlas and gutters of its own, which is more than a small one is worth. In scenes of more than a few dozen
//! surfaces those that are small in area and triangles become parts of surfaces called `atlas`, `atlas-2`, …, in the order of the file, so
//! that what was modelled together stays together. What is treated differently later stays apart: emitters, what light passes through,
//! smooth and flat shading, and the two sides of what is seen from both, whose atlases are a pair like the surfaces were. Every texel has
//! the same density whatever the part, so classes of size would save nothing.

use super::{
    name::{Names, Stems},
    tangents,
};
use kiln_proto::scene::{Scene, Surface};
use std::collections::{BTreeMap, BTreeSet};

/// Scenes of up to so many surfaces, backs not counted, are left as they are.
const FEW: usize = 32;
/// A surface is small below this share of the scene's area and this many triangles.
const SMALL_AREA: f64 = 0.01;
const SMALL_TRIANGLES: usize = 4_096;
/// What an atlas holds at most: its share of the scene's area, triangles and parts.
const ATLAS_AREA: f64 = 0.0625;
const ATLAS_TRIANGLES: usize = 65_536;
const ATLAS_PARTS: usize = 512;

/// What was grouped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Grouped {
    /// Surfaces that are parts now, backs not counted.
    pub(super) surfaces: usize,
    /// The names of those that they are parts of, backs not counted.
    pub(super) atlases: Vec<String>,
}

/// What may not share an atlas with what is different in this.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Class {
    emissive: bool,
    lets_through: bool,
    smooth: bool,
    two_sided: bool,
}

/// Groups the small surfaces of a scene with many; `None` where nothing changes. Cost: linear in the scene.
pub(super) fn group(scene: &mut Scene) -> Option<Grouped> {
    let back_of = backs(scene);
    let groups = groups(scene, &back_of);
    if groups.is_empty() {
        return None;
    }
    let grouped: BTreeSet<usize> =
        groups.iter().flatten().flat_map(|front| [Some(*front), back_of.get(front).copied()]).flatten().collect();
    let kept = scene.surfaces.iter().enumerate().filter(|(k, _)| !grouped.contains(k));
    let mut names = Names::of(kept.map(|(_, s)| s.name.as_str()));
    let mut out = Grouped { surfaces: groups.iter().map(Vec::len).sum(), atlases: vec![] };
    let mut atlases = vec![];
    for members in &groups {
        let name = names.take("atlas");
        let backs: Vec<usize> = members.iter().filter_map(|front| back_of.get(front).copied()).collect();
        let front = join(scene, members, name.clone());
        let back = (!backs.is_empty()).then(|| join(scene, &backs, names.take(&format!("{name}~back"))));
        out.atlases.push(name);
        atlases.push((front, back));
    }
    replace(scene, &grouped, atlases);
    Some(out)
}

/// The back of each front.
fn backs(scene: &Scene) -> BTreeMap<usize, usize> {
    scene.surfaces.iter().enumerate().filter_map(|(back, s)| s.back_of.map(|front| (front as usize, back))).collect()
}

/// The fronts that go together, two or more each, in the order of their first ones.
fn groups(scene: &Scene, back_of: &BTreeMap<usize, usize>) -> Vec<Vec<usize>> {
    let fronts: Vec<usize> = (0..scene.surfaces.len()).filter(|k| scene.surfaces[*k].back_of.is_none()).collect();
    if fronts.len() <= FEW {
        return vec![];
    }
    let area = |k: &usize| scene.surfaces[*k].triangles.iter().map(|t| area(scene, t.corners)).sum::<f64>();
    let areas: Vec<f64> = fronts.iter().map(area).collect();
    let whole: f64 = areas.iter().sum();
    /// A group that still grows: its members, area, triangles and parts.
    type Open = (Vec<usize>, f64, usize, usize);
    let mut open: BTreeMap<Class, Open> = BTreeMap::new();
    let mut groups = vec![];
    for (front, area) in fronts.into_iter().zip(areas) {
        let surface = &scene.surfaces[front];
        let (triangles, parts) = (surface.triangles.len(), surface.parts.len());
        if area >= SMALL_AREA * whole || triangles > SMALL_TRIANGLES || parts > ATLAS_PARTS {
            continue;
        }
        let group = open.entry(class(scene, front, back_of)).or_default();
        if group.1 + area > ATLAS_AREA * whole || group.2 + triangles > ATLAS_TRIANGLES || group.3 + parts > ATLAS_PARTS {
            groups.push(std::mem::take(group).0);
        }
        group.0.push(front);
        *group = (std::mem::take(&mut group.0), group.1 + area, group.2 + triangles, group.3 + parts);
    }
    groups.extend(open.into_values().map(|group| group.0));
    groups.retain(|members| members.len() > 1);
    groups.sort_unstable();
    groups
}

fn area(scene: &Scene, corners: [u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|k| glam::Vec3::from_array(scene.positions[k as usize]).as_dvec3());
    (b - a).cross(c - a).length() / 2.0
}

fn class(scene: &Scene, front: usize, back_of: &BTreeMap<usize, usize>) -> Class {
    let sides = || [Some(front), back_of.get(&front).copied()].into_iter().flatten().map(|k| &scene.surfaces[k]);
    Class {
        emissive: sides().any(|s| scene.is_emissive(s)),
        lets_through: sides().any(|s| scene.materials_of(s).any(kiln_proto::scene::Material::lets_through)),
        smooth: !scene.surfaces[front].normals.is_empty(),
        two_sided: back_of.contains_key(&front),
    }
}

/// One surface of the parts of several, all flat or all smooth.
fn join(scene: &mut Scene, members: &[usize], name: String) -> Surface {
    let members: Vec<&Surface> = members.iter().map(|k| &scene.surfaces[*k]).collect();
    let sets = members.iter().map(|s| s.uv_sets.len()).max().unwrap_or(0);
    let mut out = Surface { name, uv_sets: vec![vec![]; sets], ..Surface::default() };
    // A part without vertex colours among others that have them is white, one without tangents has those of its triangles.
    let white = members.iter().any(|s| !s.colors.is_empty()).then_some(scene.colors.len() as u32);
    let none = members.iter().any(|s| !s.tangents.is_empty()).then_some(scene.tangents.len() as u32);
    let (mut needs_white, mut needs_none) = (false, false);
    let mut polygons = 0;
    for s in members {
        let first = polygons;
        out.parts.extend(s.parts.iter().cloned());
        out.triangles.extend(s.triangles.iter().map(|t| {
            polygons = polygons.max(first + t.polygon + 1);
            kiln_proto::scene::Triangle { polygon: first + t.polygon, ..*t }
        }));
        for (set, uv) in out.uv_sets.iter_mut().enumerate() {
            match s.uv_sets.get(set) {
                Some(own) => uv.extend_from_slice(own),
                None => uv.extend(std::iter::repeat_n(None, s.triangles.len())),
            }
        }
        out.normals.extend_from_slice(&s.normals);
        out.tangents.extend_from_slice(&s.tangents);
        if let (Some(none), true) = (none, s.tangents.is_empty()) {
            out.tangents.extend(std::iter::repeat_n([none; 3], s.triangles.len()));
            needs_none = true;
        }
        out.colors.extend_from_slice(&s.colors);
        if let (Some(white), true) = (white, s.colors.is_empty()) {
            out.colors.extend(std::iter::repeat_n([white; 3], s.triangles.len()));
            needs_white = true;
        }
    }
    if needs_white {
        scene.colors.push([1.0; 4]);
    }
    if needs_none {
        scene.tangents.push(tangents::NONE);
    }
    out
}

/// Takes the grouped surfaces out and puts the atlases behind the others, each back behind its front.
fn replace(scene: &mut Scene, grouped: &BTreeSet<usize>, atlases: Vec<(Surface, Option<Surface>)>) {
    let mut moved = vec![0; scene.surfaces.len()];
    let mut kept = vec![];
    for (k, surface) in std::mem::take(&mut scene.surfaces).into_iter().enumerate() {
        moved[k] = kept.len() as u32;
        if !grouped.contains(&k) {
            kept.push(surface);
        }
    }
    for surface in &mut kept {
        surface.back_of = surface.back_of.map(|front| moved[front as usize]);
    }
    let mut stems = Stems::of(kept.iter().map(|s| s.file_stem.as_str()));
    for (front, back) in atlases {
        let index = kept.len() as u32;
        kept.push(Surface { file_stem: stems.take(&front.name), ..front });
        kept.extend(back.map(|b| Surface { file_stem: stems.take(&b.name), back_of: Some(index), ..b }));
    }
    scene.surfaces = kept;
}

#[cfg(test)]
mod tests {
    use super::*;
    use kiln_proto::{
        scene::{Material, Opacity, Triangle},
        units::Rgb,
    };

    /// A floor of 10 m x 10 m and `small` squares of 10 cm, whose materials are `of`'s.
    fn scene(small: usize, of: impl Fn(usize) -> u32) -> Scene {
        let mut s = Scene::empty();
        let clear = Opacity { mode: kiln_proto::scene::AlphaMode::Blend, factor: 0.5, texture: None };
        s.materials = vec![
            Material::matt("grey", Rgb::splat(0.5)),
            Material::matt("lamp", Rgb::BLACK).emitting(Rgb::WHITE),
            Material { opacity: clear, ..Material::matt("glass", Rgb::splat(0.1)) },
        ];
        for k in 0..=small {
            let (x, side, at) = (k as f32, if k == 0 { 10.0 } else { 0.1 }, s.positions.len() as u32);
            s.positions.extend([[x, 0.0, 0.0], [x + side, 0.0, 0.0], [x + side, side, 0.0], [x, side, 0.0]]);
            let uv = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
            let triangle = |c: [usize; 3]| (Triangle { corners: c.map(|k| at + k as u32), polygon: 0 }, Some(c.map(|k| uv[k])));
            s.surfaces.push(Surface::plain(format!("s{k}"), of(k), vec![triangle([0, 1, 2]), triangle([0, 2, 3])]));
        }
        s
    }

    /// Gives a surface a back.
    fn two_sided(s: &mut Scene, front: usize) {
        let mut back = s.surfaces[front].clone();
        (back.name, back.file_stem, back.back_of) = (format!("{}~back", back.name), format!("{}-back", back.name), Some(front as u32));
        back.triangles.iter_mut().for_each(|t| t.corners.swap(1, 2));
        s.surfaces.push(back);
    }

    #[test]
    fn small_surfaces_of_large_scenes_become_parts_and_nothing_is_lost() {
        let mut few = scene(31, |_| 0);
        assert_eq!(group(&mut few), None);
        let mut many = scene(40, |_| 0);
        many.surfaces[7].colors = vec![[0; 3]; 2];
        many.colors = vec![[0.5; 4]];
        (many.surfaces[9].tangents, many.tangents) = (vec![[0; 3]; 2], vec![[0.0, 1.0, 0.0, -1.0]]);
        many.surfaces[0].name = "atlas".into();
        let before = many.clone();
        let grouped = group(&mut many).unwrap();
        assert_eq!(grouped, Grouped { surfaces: 40, atlases: vec!["atlas-2".into()] }, "the floor is called atlas");
        many.validate().unwrap();
        let atlas = &many.surfaces[1];
        assert_eq!((many.surfaces.len(), atlas.parts.len(), atlas.triangles.len(), atlas.triangles[5].polygon), (2, 40, 80, 2));
        assert_eq!(atlas.parts.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), (1..=40).map(|k| format!("s{k}")).collect::<Vec<_>>());
        let corners = |s: &Scene| s.surfaces.iter().flat_map(|s| s.triangles.iter().map(|t| t.corners)).collect::<Vec<_>>();
        assert_eq!(corners(&many), corners(&before));
        assert_eq!((atlas.uv_sets[0].len(), atlas.uv(0, 3)), (80, before.surfaces[2].uv(0, 1)));
        assert_eq!((atlas.tangents[16], atlas.tangents[0], many.tangents[1]), ([0; 3], [1; 3], tangents::NONE));
        assert_eq!((atlas.colors[12], atlas.colors[0], many.colors[1]), ([0; 3], [1; 3], [1.0; 4]));
    }

    #[test]
    fn what_differs_stays_apart_and_backs_stay_with_their_fronts() {
        let mut s = scene(60, |k| match k {
            1..=10 => 1,
            11..=20 => 2,
            _ => 0,
        });
        for front in [31, 35, 33] {
            two_sided(&mut s, front);
        }
        s.validate().unwrap();
        let grouped = group(&mut s).unwrap();
        s.validate().unwrap();
        assert_eq!(grouped.atlases, ["atlas", "atlas-2", "atlas-3", "atlas-4"]);
        let parts = |name: &str| s.surface(name).unwrap().1.parts.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
        assert_eq!((parts("atlas").len(), parts("atlas-2").len(), parts("atlas-3").len()), (10, 10, 37));
        assert_eq!((parts("atlas-4"), parts("atlas-4~back").len()), (vec!["s31".to_owned(), "s33".into(), "s35".into()], 3));
        let (front, _) = s.surface("atlas-4").unwrap();
        assert_eq!(s.surface("atlas-4~back").unwrap().1.back_of, Some(front as u32));
        assert!(s.is_emissive(s.surface("atlas").unwrap().1));
    }

    #[test]
    fn an_atlas_is_bounded() {
        let mut s = scene(1_300, |_| 0);
        assert_eq!(group(&mut s).unwrap().atlases.len(), 3, "512 parts each");
        s.validate().unwrap();
    }
}
