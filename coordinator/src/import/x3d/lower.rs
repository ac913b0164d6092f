//! `receiveShadows` written out: the shortcut of Kamburelis, "Shadow maps and projective texturing in X3D", as the nodes that it stands for
//! (section 4.7).
//!
//! A light that an appearance receives shadows from becomes a GeneratedShadowMap behind the author's textures, in a MultiTexture with the
//! mode MODULATE, and a ProjectedTextureCoordinate behind the author's coordinates of every geometry that the appearance is used with. Both
//! name the light by USE, and all receivers of a light share them. The map has the parameters of the light's `defaultShadowMap`; without
//! one it is made for every frame with the defaults. The fields of lights stay as they are. A point light looks nowhere in particular and
//! cannot be a projector (4.5): its shortcut stays.
//!
//! Nodes are changed where they stand if nobody else uses them, and copied otherwise: a geometry that is used with two appearances may need
//! coordinates for one number of textures here and another there.

mod edit;
#[cfg(test)]
mod tests;

use super::{
    document::{Document, NodeId},
    scene::of_colour,
    value::Value,
};
use crate::import::findings::Findings;
use edit::Editor;
use std::{collections::BTreeMap, sync::Arc};

/// What an appearance has become.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Plan {
    /// Textures of the author's.
    textures: usize,
    /// Lights whose maps follow them.
    lights: Vec<NodeId>,
}

/// Rewrites the appearances of a document; returns how many.
pub(super) fn lower(document: &mut Document, findings: &mut Findings) -> usize {
    let mut lowering = Lowering { edit: Editor::new(document), findings, maps: BTreeMap::new() };
    let appearances = lowering.edit.of_kind("Appearance");
    let plans: BTreeMap<NodeId, Plan> = appearances.into_iter().filter_map(|id| Some((id, lowering.appearance(id)?))).collect();
    lowering.shapes(&plans);
    plans.len()
}

struct Lowering<'d, 'f> {
    edit: Editor<'d>,
    findings: &'f mut Findings,
    /// The map and the coordinates of each light.
    maps: BTreeMap<NodeId, [NodeId; 2]>,
}

impl Lowering<'_, '_> {
    /// Gives an appearance its shadow maps; `None` where it receives no shadows that can be written out.
    fn appearance(&mut self, id: NodeId) -> Option<Plan> {
        let mut lights: Vec<NodeId> = vec![];
        let mut rest = vec![];
        for light in self.edit.nodes(id, "receiveShadows") {
            match self.edit.kind(light) {
                "SpotLight" | "DirectionalLight" if lights.contains(&light) => {}
                "SpotLight" | "DirectionalLight" => lights.push(light),
                _ => {
                    let what = "lights in receiveShadows that cannot be a camera (only SpotLight and DirectionalLight can) were left there";
                    self.findings.count(self.edit.at(light), what);
                    rest.push(light);
                }
            }
        }
        if lights.is_empty() {
            return None;
        }
        self.edit.set(id, "receiveShadows", Value::Nodes(rest.into()));
        let materials = ["material", "backMaterial", "shaders"].into_iter().flat_map(|field| self.edit.nodes(id, field));
        if materials.into_iter().any(|m| self.edit.node(m, of_colour(self.edit.kind(m))).is_some()) {
            let what = "materials with textures of their own take the place of the shadow maps behind the appearance's texture in X3D 4";
            self.findings.count(self.edit.at(id), what);
        }
        let textures = self.textures(id, &lights);
        self.transforms(id, textures);
        Some(Plan { textures, lights })
    }

    /// Puts the maps of lights behind the author's textures; returns how many those are.
    fn textures(&mut self, appearance: NodeId, lights: &[NodeId]) -> usize {
        let place = appearance;
        let (multi, mut list) = match self.edit.node(appearance, "texture") {
            Some(multi) if self.edit.kind(multi) == "MultiTexture" => {
                let own = self.edit.own(multi, 1);
                (own, self.edit.nodes(own, "texture"))
            }
            single => (self.edit.create("MultiTexture", place), single.into_iter().collect()),
        };
        let textures = list.len();
        let mut modes = self.edit.strings(multi, "mode");
        modes.truncate(textures);
        modes.resize(textures + lights.len(), Arc::from("MODULATE"));
        let maps: Vec<NodeId> = lights.iter().map(|light| self.map(*light)[0]).collect();
        list.extend(maps);
        self.edit.set(multi, "texture", Value::Nodes(list.into()));
        self.edit.set(multi, "mode", Value::Strings(modes.into()));
        self.edit.set(appearance, "texture", Value::node(multi));
        textures
    }

    /// A transform for all textures becomes one for the author's alone: projected coordinates are not to be moved.
    fn transforms(&mut self, appearance: NodeId, textures: usize) {
        let Some(single) = self.edit.node(appearance, "textureTransform") else { return };
        if self.edit.kind(single) == "MultiTextureTransform" {
            let list = self.edit.nodes(single, "textureTransform");
            if list.len() > textures {
                let own = self.edit.own(single, 1);
                self.edit.set(own, "textureTransform", Value::Nodes(list[..textures].into()));
                self.edit.set(appearance, "textureTransform", Value::node(own));
            }
            return;
        }
        let multi = self.edit.create("MultiTextureTransform", appearance);
        self.edit.set(multi, "textureTransform", Value::Nodes(vec![single; textures].into()));
        self.edit.set(appearance, "textureTransform", Value::node(multi));
    }

    /// The shadow map of a light and the coordinates that it projects.
    fn map(&mut self, light: NodeId) -> [NodeId; 2] {
        if let Some(known) = self.maps.get(&light) {
            return *known;
        }
        let map = self.edit.create("GeneratedShadowMap", light);
        match self.edit.node(light, "defaultShadowMap") {
            Some(parameters) => self.edit.copy_fields(parameters, map),
            None => self.edit.set(map, "update", Value::Strings([Arc::from("ALWAYS")].into())),
        }
        self.edit.set(map, "light", Value::node(light));
        let coordinates = self.edit.create("ProjectedTextureCoordinate", light);
        self.edit.set(coordinates, "projector", Value::node(light));
        self.maps.insert(light, [map, coordinates]);
        [map, coordinates]
    }

    /// Gives the geometry of every shape the coordinates that its appearance needs.
    fn shapes(&mut self, plans: &BTreeMap<NodeId, Plan>) {
        let mut wanted: BTreeMap<(NodeId, &Plan), Vec<NodeId>> = BTreeMap::new();
        for shape in self.edit.of_kind("Shape") {
            let plan = self.edit.node(shape, "appearance").and_then(|a| plans.get(&a));
            if let (Some(plan), Some(geometry)) = (plan, self.edit.node(shape, "geometry")) {
                wanted.entry((geometry, plan)).or_default().push(shape);
            }
        }
        for ((geometry, plan), shapes) in wanted {
            if !self.edit.has(geometry, "texCoord") {
                let what = "geometry without a field texCoord cannot be given the coordinates of its shadow maps";
                self.findings.count(self.edit.at(geometry), what);
                continue;
            }
            let own = self.edit.own(geometry, shapes.len());
            self.coordinates(own, plan);
            for shape in shapes {
                self.edit.set(shape, "geometry", Value::node(own));
            }
        }
    }

    /// Puts the coordinates of a plan's lights behind the author's.
    fn coordinates(&mut self, geometry: NodeId, plan: &Plan) {
        let (multi, mut list) = match self.edit.node(geometry, "texCoord") {
            Some(multi) if self.edit.kind(multi) == "MultiTextureCoordinate" => {
                let own = self.edit.own(multi, 1);
                (own, self.edit.nodes(own, "texCoord"))
            }
            // One set of coordinates serves all textures (ISO/IEC 19775-1: 18.2.3).
            Some(single) => (self.edit.create("MultiTextureCoordinate", geometry), vec![single; plan.textures]),
            None => (self.edit.create("MultiTextureCoordinate", geometry), vec![]),
        };
        list.truncate(plan.textures);
        while list.len() < plan.textures {
            // What a texture without coordinates has anyway: those of the bounding box.
            let bounds = self.edit.create("TextureCoordinateGenerator", geometry);
            self.edit.set(bounds, "mode", Value::Strings([Arc::from("BOUNDS")].into()));
            list.push(bounds);
        }
        let lights: Vec<NodeId> = plan.lights.iter().map(|light| self.map(*light)[1]).collect();
        list.extend(lights);
        self.edit.set(multi, "texCoord", Value::Nodes(list.into()));
        self.edit.set(geometry, "texCoord", Value::node(multi));
    }
}
