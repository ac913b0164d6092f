//! What is gathered, a texel or a single point, and what its material is like on the whole.

use super::{
    directions::across,
    footprint::Points,
    gather::{Sample, Shape},
};
use crate::{
    bsdf::Specular,
    sampling::{Dimension, TexelKey},
    scene::{BakeScene, Polish, Vertex},
};
use glam::Vec3;
use kiln_proto::{
    frame::Frame,
    scene::{Material, Reflection},
    units::Rgb,
};

/// Points whose mean a textured texel's density is made for.
const POINTS: u32 = 16;
/// Narrower facets, and Phong exponents above the second number, are aimed at by sets of neighbouring directions: a lobe of the whole
/// grid's mixture would get too few samples, because it overlaps few others.
const SHARP: (f32, f32) = (0.05, 200.0);
/// Width of facets that lobes are drawn for where none of a texel's points is rough, though some of it may be: so wide that a narrower lobe
/// is met now and then.
const WIDE: f32 = 0.25;
/// Bounds of the share of samples that a translucent surface takes from behind.
const BEHIND: (f32, f32) = (0.2, 0.8);

/// What is gathered: a texel or a single point.
pub(crate) struct Site<'a> {
    /// Index of the surface.
    pub(crate) surface: usize,
    /// Its frame.
    pub(crate) frame: Frame,
    /// Where on the surface samples arrive.
    pub(crate) points: Points<'a>,
    /// The root of its samples.
    pub(crate) key: TexelKey,
}

impl Site<'_> {
    /// The material of its centre, which all of its points share.
    pub(super) fn material<'s>(&self, scene: &'s BakeScene) -> &'s Material {
        scene.material_of(scene.prim_of(self.surface, self.points.triangle()))
    }

    /// The vertex of a sample, in the surface's own frame at its point. Where a chart runs on into another material, the centre stands in.
    pub(super) fn vertex(&self, scene: &BakeScene, index: u32, dimension: fn(u32) -> Dimension) -> Vertex {
        let mut point = self.points.at(self.key, index, dimension);
        let prim = |triangle: u32| scene.prim(scene.prim_of(self.surface, triangle));
        if point.triangle != self.points.triangle() && prim(point.triangle).material != prim(self.points.triangle()).material {
            point = self.points.centre();
        }
        let frame = self.points.frame(&point).unwrap_or(self.frame);
        scene.vertex_at(self.surface, &point, frame)
    }

    /// What it emits by itself on average, W/(sr m²): not multiplied by its opacity, which whoever shows it does.
    pub(super) fn emission(&self, scene: &BakeScene, samples: u32) -> Rgb {
        let material = self.material(scene);
        if material.emission_texture.is_none() || !material.is_emissive() {
            return material.emission;
        }
        let mut sum = Rgb::BLACK;
        for index in 0..samples {
            let point = self.points.at(self.key, index, Dimension::footprint);
            sum += scene.emission(scene.prim_of(self.surface, point.triangle), point.bary);
        }
        sum * (1.0 / samples as f32)
    }
}

/// A material averaged over a site: what its samples are drawn for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mean {
    pub(super) shape: Shape,
    /// The mean of the normals that reflection sees, local.
    pub(super) normal: Vec3,
    /// Whether directions may have mirror images of their own; points of the footprint that are rough have none.
    pub(super) is_mirror: bool,
    /// Whether anything is left to gather.
    pub(super) is_gathered: bool,
    /// The share of samples from behind; 0 unless translucent.
    pub(super) behind: f32,
}

impl Mean {
    /// Cost: a look-up of all textures per point.
    pub(super) fn of(scene: &BakeScene, site: &Site<'_>) -> Self {
        let material = site.material(scene);
        let varies = material.textures().next().is_some() || scene.prim(scene.prim_of(site.surface, site.points.triangle())).is_colored;
        let points = if varies { POINTS } else { 1 };
        let (mut normal, mut alpha, mut rough, mut parts) = (Vec3::ZERO, 0.0, 0, [0.0f32; 3]);
        // What varies may be black at all of these points and bright between them: the points say how to draw, not whether.
        let is_gathered = varies && material.reflection != Reflection::None;
        let polish = scene.polish_of(scene.prim_of(site.surface, site.points.triangle()));
        let mut mean = Self { shape: Shape::Matte, normal: Vec3::Z, is_mirror: polish != Polish::Nowhere, is_gathered, behind: 0.0 };
        for index in 0..points {
            let vertex = site.vertex(scene, index, Dimension::footprint);
            normal += local_normal(&vertex);
            mean.is_gathered |= vertex.bsdf.is_smooth();
            match vertex.bsdf.specular {
                Specular::None | Specular::Mirror { .. } => {}
                Specular::Phong { exponent, .. } => mean.shape = Shape::Phong(exponent),
                Specular::Coat(coat) => {
                    alpha += coat.alpha;
                    rough += u32::from(coat.alpha > 0.0);
                    let part = [coat.through.mean() * coat.kept, coat.normal.mean(), vertex.bsdf.diffuse.mean() * coat.kept];
                    (0..3).for_each(|k| parts[k] += part[k]);
                }
            }
        }
        // Summing equal unit vectors may not give a unit vector back to the last bit.
        if normal != Vec3::Z * points as f32 {
            mean.normal = normal.normalize_or(Vec3::Z);
        }
        if let Reflection::MetallicRoughness(m) = &material.reflection {
            mean.shape = Shape::Facets(match polish {
                Polish::Everywhere => 0.0,
                _ if rough == 0 => WIDE,
                _ => alpha / rough as f32,
            });
            if (parts[0] > 0.0 || (varies && m.transmission > 0.0)) && polish != Polish::Everywhere {
                mean.behind = (parts[0] / parts.iter().sum::<f32>().max(f32::MIN_POSITIVE)).clamp(BEHIND.0, BEHIND.1);
            }
        }
        mean
    }

    /// Whether there are lobes to draw from.
    pub(super) fn has_lobes(&self) -> bool {
        match self.shape {
            Shape::Matte => false,
            Shape::Phong(_) => true,
            Shape::Facets(alpha) => alpha > 0.0,
        }
    }

    /// Whether its lobes are too narrow for one mixture of all directions.
    pub(super) fn is_sharp(&self) -> bool {
        match self.shape {
            Shape::Matte => false,
            Shape::Phong(exponent) => exponent.value() > SHARP.1,
            Shape::Facets(alpha) => alpha > 0.0 && alpha < SHARP.0,
        }
    }
}

impl Sample {
    /// A sample of light that arrives at a vertex from a local direction; `None` where it cannot reach the viewer's side.
    pub(super) fn arriving(vertex: &Vertex, wi: Vec3, mean_normal: Vec3) -> Option<Sample> {
        let normal = local_normal(vertex);
        let front = wi.z > 0.0;
        if !front && (wi.z == 0.0 || !vertex.bsdf.is_translucent()) {
            return None;
        }
        let on_side = |n: Vec3| if front { wi } else { across(wi, n) };
        let (own, mixed) = (on_side(normal), on_side(mean_normal));
        let dark = Sample {
            wi,
            mixed,
            own,
            normal,
            emitted: Rgb::BLACK,
            light_pdf: 0.0,
            reflected: Rgb::BLACK,
            direct: Rgb::BLACK,
            bsdf: vertex.bsdf,
        };
        (normal.dot(own) > 0.0).then_some(dark)
    }
}

/// The normal that reflection sees, in the frame of the hemisphere.
fn local_normal(vertex: &Vertex) -> Vec3 {
    if vertex.shading == vertex.frame { Vec3::Z } else { vertex.frame.to_local(vertex.shading.normal) }
}
