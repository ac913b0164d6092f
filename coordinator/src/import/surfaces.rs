//! Surfaces from meshes in the world, one after the other, until they are the geometry of a scene: what all importers do alike.
//!
//! A mesh is handed over whole with the polygons of it that one surface takes, so that importers may compute on the file as one mesh
//! (normals across objects, say) and still make many surfaces of it. Cost: linear in the corners, but for concave polygons
//! (`mesh::triangulate`).

use super::{
    findings::{At, Findings},
    mesh::Mesh,
    name::{Names, Stems},
    two_sided,
    weld::Weld,
};
use glam::{DVec3, Vec3};
use kiln_proto::{
    limits,
    scene::{Part, Scene, ShadowMap, Surface, Triangle},
};

/// Characters of a surface's name that are kept.
pub(super) const NAME_CHARS: usize = limits::NAME_BYTES / 8;

/// What a surface looks like.
#[derive(Default)]
pub(super) struct Look<'n> {
    pub(super) name: &'n str,
    pub(super) front: u32,
    /// The material of the back, where it is another one.
    pub(super) back: Option<u32>,
    pub(super) two_sided: bool,
    pub(super) casts_shadows: bool,
    pub(super) receive_shadows: Vec<u32>,
    pub(super) unlit_by: Vec<u32>,
    pub(super) shadow_maps: Vec<(u32, ShadowMap)>,
}

/// What a surface is called: like its object, and `OBJECT.MATERIAL` where the object has several materials. Of a long name of an object
/// the end is kept, from a word on: CAD programs list the assemblies around a part before it, and the beginning is what all parts share.
pub(super) fn called(object: &str, material: Option<&str>) -> String {
    let ending: String = material.into_iter().flat_map(|name| ['.'].into_iter().chain(name.chars())).take(NAME_CHARS / 2).collect();
    let room = NAME_CHARS - ending.chars().count();
    let Some((from, _)) = object.char_indices().rev().nth(room) else { return format!("{object}{ending}") };
    let end = object[from..].trim_start_matches(|c: char| !c.is_whitespace()).trim_start();
    // A word that is too long itself begins anywhere.
    let last = || object[from..].chars().skip(1).collect();
    let kept = if end.is_empty() { last() } else { end.to_owned() };
    format!("{kept}{ending}")
}

/// The mean of vertex colours, for materials that cannot take them vertex by vertex; `None` where there are none.
pub(super) fn mean_colour(colours: impl Iterator<Item = [f32; 4]>) -> Option<[f32; 3]> {
    let mut count = 0u32;
    let sum = colours.fold(DVec3::ZERO, |sum, [r, g, b, _]| {
        count += 1;
        sum + Vec3::new(r, g, b).as_dvec3()
    });
    (count > 0).then(|| (sum / f64::from(count)).as_vec3().to_array())
}

/// The surfaces of a scene so far.
#[derive(Default)]
pub(super) struct Surfaces {
    pub(super) weld: Weld,
    fronts: Vec<Surface>,
    two_sided: Vec<bool>,
    /// Materials of backs.
    backs: Vec<Option<u32>>,
    names: Names,
    stems: Stems,
}

impl Surfaces {
    /// Adds these polygons of a mesh in world space as one surface; `at` is where a polygon stands in the file. False where no triangle is
    /// left of them, so that there is no surface.
    pub(super) fn add<'p>(
        &mut self,
        mesh: &Mesh,
        polygons: impl Iterator<Item = usize>,
        look: Look<'_>,
        at: impl Fn(usize) -> At<'p>,
        findings: &mut Findings,
    ) -> bool {
        let mut surface = Surface { uv_sets: vec![vec![]; mesh.uv_sets.len().min(limits::UV_SETS)], ..Surface::default() };
        let mut normals = vec![];
        for (number, polygon) in polygons.enumerate() {
            self.polygon(mesh, polygon, number as u32, &mut surface, &mut normals, at(polygon), findings);
        }
        if surface.triangles.is_empty() {
            return false;
        }
        while surface.uv_sets.last().is_some_and(|set| set.iter().all(Option::is_none)) {
            surface.uv_sets.pop();
        }
        surface.normals = normals.iter().map(|n| n.map(|n| self.weld.normals.id(n))).collect();
        let part = Part {
            casts_shadows: look.casts_shadows,
            receive_shadows: look.receive_shadows,
            unlit_by: look.unlit_by,
            shadow_maps: look.shadow_maps,
            ..Part::plain("", look.front, surface.triangles.len())
        };
        self.push(surface, part, look.name, look.two_sided, look.back);
        true
    }

    #[allow(clippy::too_many_arguments)] // A polygon, where it comes from and where it goes.
    fn polygon(
        &mut self,
        mesh: &Mesh,
        polygon: usize,
        number: u32,
        surface: &mut Surface,
        normals_of: &mut Vec<[[f32; 3]; 3]>,
        at: At<'_>,
        findings: &mut Findings,
    ) {
        let cut = mesh.cut(polygon);
        if !cut.sound {
            findings.count(at, "polygons that cross themselves were cut as well as they can be");
        }
        let first = mesh.run(polygon).start;
        for t in cut.triangles.iter().map(|t| t.map(|i| first + i)) {
            let corners = t.map(|c| self.weld.positions.id(mesh.positions[mesh.corners[c] as usize]));
            if let Err(left) = self.weld.triangle(corners) {
                findings.count(at, left.words());
                continue;
            }
            surface.triangles.push(Triangle { corners, polygon: number });
            for (set, channel) in surface.uv_sets.iter_mut().zip(&mesh.uv_sets) {
                let [a, b, c] = t.map(|c| channel.find(c));
                set.push(a.zip(b).zip(c).map(|((a, b), c)| [a, b, c]));
            }
            normals_of.extend(mesh.normals.iter().map(|normals| t.map(|c| normals.get(c))));
            if let Some(colours) = &mesh.colours {
                surface.colors.push(t.map(|c| self.weld.colors.id(colours.get(c))));
            }
        }
    }

    /// Adds a surface of this name and part, the names of both still to be given.
    pub(super) fn push(&mut self, mut surface: Surface, part: Part, name: &str, two_sided: bool, back: Option<u32>) {
        let wanted: String = name.chars().take(NAME_CHARS).collect();
        surface.name = self.names.take(&wanted);
        surface.file_stem = self.stems.take(&surface.name);
        surface.parts = vec![Part { name: surface.name.clone(), ..part }];
        self.fronts.push(surface);
        self.two_sided.push(two_sided);
        self.backs.push(back);
    }

    /// Surfaces so far, backs not counted.
    pub(super) fn len(&self) -> usize {
        self.fronts.len()
    }

    /// Hands all over to the scene, with backs.
    pub(super) fn finish(self, scene: &mut Scene) {
        (scene.positions, scene.normals) = (self.weld.positions.values, self.weld.normals.values);
        (scene.tangents, scene.colors) = (self.weld.tangents.values, self.weld.colors.values);
        scene.surfaces = self.fronts;
        two_sided::split(scene, &self.two_sided);
        let mut backs = self.backs.into_iter();
        let mut material = None;
        for surface in &mut scene.surfaces {
            if surface.back_of.is_none() {
                material = backs.next().flatten();
            } else if let Some(back) = material {
                surface.parts.iter_mut().for_each(|p| p.material = back);
            }
        }
    }
}
