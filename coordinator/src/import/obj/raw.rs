//! What an MTL material states: words with their meaning, values with their lines. Nothing is decided here.

use super::map::Map;
use crate::import::{BundlePath, findings::At};
use kiln_proto::units::Rgb;
use std::collections::BTreeMap;

/// A value with the line that states it.
pub(super) type Stated<T> = Option<(u32, T)>;

/// Numbers that a material may state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Number {
    /// Ns.
    Exponent,
    /// `d`.
    Opacity,
    /// `Tr`.
    Transparency,
    /// Ni.
    Refraction,
    /// Pr.
    Roughness,
    /// Pm.
    Metallic,
    /// Pc.
    Coat,
    /// Pcr.
    CoatRoughness,
}

/// Textures that a material may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    /// map_Kd.
    Diffuse,
    /// map_Ks.
    Specular,
    /// map_Ns.
    Exponent,
    /// map_Ke.
    Emission,
    /// map_d.
    Opacity,
    /// `norm`.
    Normal,
    /// `bump`, map_Bump.
    Bump,
    /// map_Pr.
    Roughness,
    /// map_Pm.
    Metallic,
}

/// Words, in lower case, of textures.
const MAPS: [(&str, Role); 13] = [
    ("map_kd", Role::Diffuse),
    ("map_ks", Role::Specular),
    ("map_ns", Role::Exponent),
    ("map_ke", Role::Emission),
    ("map_emissive", Role::Emission),
    ("map_d", Role::Opacity),
    ("map_opacity", Role::Opacity),
    ("norm", Role::Normal),
    ("map_kn", Role::Normal),
    ("bump", Role::Bump),
    ("map_bump", Role::Bump),
    ("map_pr", Role::Roughness),
    ("map_pm", Role::Metallic),
];

/// One `newmtl` block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct RawMaterial {
    /// The file that defines it.
    pub(super) file: BundlePath,
    /// The line of `newmtl`.
    pub(super) line: u32,
    /// Kd.
    pub(super) diffuse: Stated<Rgb>,
    /// Ks.
    pub(super) specular: Stated<Rgb>,
    /// Ke.
    pub(super) emission: Stated<Rgb>,
    /// Tf.
    pub(super) filter: Stated<Rgb>,
    /// illum.
    pub(super) model: Stated<u32>,
    numbers: BTreeMap<Number, (u32, f32)>,
    maps: BTreeMap<Role, (u32, Map)>,
}

impl RawMaterial {
    /// One that states nothing.
    pub(super) fn new(file: &BundlePath, line: u32) -> Self {
        Self {
            file: file.clone(),
            line,
            diffuse: None,
            specular: None,
            emission: None,
            filter: None,
            model: None,
            numbers: BTreeMap::new(),
            maps: BTreeMap::new(),
        }
    }

    /// States a number; the last statement counts.
    pub(super) fn set_number(&mut self, number: Number, line: u32, value: f32) {
        self.numbers.insert(number, (line, value));
    }

    /// Names a texture; the last statement counts.
    pub(super) fn set_map(&mut self, role: Role, line: u32, map: Map) {
        self.maps.insert(role, (line, map));
    }

    /// A number, where it is stated.
    pub(super) fn number(&self, number: Number) -> Option<f32> {
        self.numbers.get(&number).map(|(_, v)| *v)
    }

    /// A texture with its line, where one is named.
    pub(super) fn map(&self, role: Role) -> Option<(At<'_>, &Map)> {
        self.maps.get(&role).map(|(line, map)| (At::line(self.file.as_str(), *line), map))
    }

    /// Where a number is stated, else where the material begins.
    pub(super) fn at(&self, number: Number) -> At<'_> {
        At::line(self.file.as_str(), self.numbers.get(&number).map_or(self.line, |(line, _)| *line))
    }
}

/// Materials by name.
pub(super) type Library = BTreeMap<String, RawMaterial>;

/// The role of a texture statement.
pub(super) fn role(word: &str) -> Option<Role> {
    MAPS.iter().find(|(w, _)| word.eq_ignore_ascii_case(w)).map(|(_, role)| *role)
}
