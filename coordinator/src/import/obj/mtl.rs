//! Materials as an MTL text states them, each value with its line.
//!
//! Read here and not with `tobj`: that keeps no lines, panics in no case but gives up at the first fault, wants three numbers where the
//! format allows one, and takes options of `map_Kd` for part of the file name.

use super::{
    map::{self, Map},
    text,
};
use crate::import::{
    BundlePath,
    findings::{At, Findings},
};
use kiln_proto::{limits, units::Rgb};
use std::collections::BTreeMap;

/// A value with the line that states it.
pub(super) type Stated<T> = Option<(u32, T)>;

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
    /// Ns.
    pub(super) exponent: Stated<f32>,
    /// Opacity: `d`, or 1 - `Tr`.
    pub(super) opacity: Stated<f32>,
    /// illum.
    pub(super) model: Stated<u32>,
    /// map_Kd.
    pub(super) diffuse_map: Stated<Map>,
    /// map_Ke.
    pub(super) emission_map: Stated<Map>,
}

/// Materials by name.
pub(super) type Library = BTreeMap<String, RawMaterial>;

/// Adds the materials of one text to `library`.
pub(super) fn read(file: &BundlePath, text: &str, library: &mut Library, findings: &mut Findings) {
    let mut reader = Reader { file, findings };
    let mut current: Option<(String, RawMaterial)> = None;
    for statement in text::statements(text) {
        let (word, rest) = statement.split();
        if word == "newmtl" {
            if let Some((name, material)) = current.take() {
                reader.define(library, name, material);
            }
            current = reader.begin(statement.line, rest);
        } else if let Some((_, material)) = &mut current {
            reader.statement(statement.line, word, rest, material);
        } else {
            reader.findings.warn_once(
                At::line(file.as_str(), statement.line),
                "outside",
                "statements before the first `newmtl` were ignored",
            );
        }
        if reader.findings.is_full() {
            return;
        }
    }
    if let Some((name, material)) = current {
        reader.define(library, name, material);
    }
}

struct Reader<'a> {
    file: &'a BundlePath,
    findings: &'a mut Findings,
}

impl Reader<'_> {
    fn error(&mut self, line: u32, message: impl Into<String>) {
        self.findings.error(At::line(self.file.as_str(), line), message);
    }

    fn begin(&mut self, line: u32, name: &str) -> Option<(String, RawMaterial)> {
        if name.is_empty() || name.len() > limits::NAME_BYTES {
            self.error(line, format!("a material's name has 1 to {} bytes; this one has {}", limits::NAME_BYTES, name.len()));
            return None;
        }
        let material = RawMaterial {
            file: self.file.clone(),
            line,
            diffuse: None,
            specular: None,
            emission: None,
            exponent: None,
            opacity: None,
            model: None,
            diffuse_map: None,
            emission_map: None,
        };
        Some((name.to_owned(), material))
    }

    fn define(&mut self, library: &mut Library, name: String, material: RawMaterial) {
        if let Some(old) = library.get(&name) {
            let message = format!("the material `{name}` was already defined at {}:{}; this definition counts", old.file, old.line);
            self.findings.warn(At::line(self.file.as_str(), material.line), message);
        }
        library.insert(name, material);
    }

    fn statement(&mut self, line: u32, word: &str, rest: &str, m: &mut RawMaterial) {
        match word {
            "Kd" => m.diffuse = self.colour(line, word, rest).or(m.diffuse),
            "Ks" => m.specular = self.colour(line, word, rest).or(m.specular),
            "Ke" => m.emission = self.colour(line, word, rest).or(m.emission),
            "Ns" => m.exponent = self.number(line, word, rest).or(m.exponent),
            "d" => m.opacity = self.number(line, word, rest.strip_prefix("-halo").unwrap_or(rest)).or(m.opacity),
            "Tr" => m.opacity = self.number(line, word, rest).map(|(l, tr)| (l, 1.0 - tr)).or(m.opacity),
            "illum" => m.model = self.model(line, rest).or(m.model),
            "map_Kd" | "map_kd" => m.diffuse_map = self.map(line, word, rest).or(m.diffuse_map.take()),
            "map_Ke" | "map_ke" => m.emission_map = self.map(line, word, rest).or(m.emission_map.take()),
            // Ambient light is what the bake computes; refraction has no meaning for opaque surfaces; the rest concerns filtering.
            "Ka" | "Ni" | "map_Ka" | "map_ka" | "sharpness" | "map_aat" => {}
            other => {
                let shown: String = other.chars().take(40).collect();
                let message = format!("`{shown}` is not supported and was ignored");
                self.findings.warn_once(At::line(self.file.as_str(), line), &shown, message);
            }
        }
    }

    /// One or three finite numbers that are not negative; one stands for all three.
    fn colour(&mut self, line: u32, word: &str, rest: &str) -> Stated<Rgb> {
        let words: Vec<&str> = rest.split_whitespace().take(4).collect();
        if matches!(words.first(), Some(&"spectral" | &"xyz")) {
            self.error(line, format!("{word} is given as `{}`; only RGB numbers are supported", words[0]));
            return None;
        }
        let values = words.iter().map(|w| self.finite(line, word, w)).collect::<Option<Vec<f32>>>()?;
        let rgb = match values.as_slice() {
            [v] => Rgb::splat(*v),
            [r, g, b] => Rgb::new(*r, *g, *b),
            _ => {
                self.error(line, format!("{word} has {} numbers; 1 or 3 are allowed", values.len()));
                return None;
            }
        };
        if let Some(negative) = values.iter().find(|v| **v < 0.0) {
            self.error(line, format!("{word} is {negative}, but light cannot be negative"));
            return None;
        }
        // -0.0 passes the test above and must not reach the canonical bytes.
        Some((line, rgb + Rgb::BLACK))
    }

    fn number(&mut self, line: u32, word: &str, rest: &str) -> Stated<f32> {
        let Some(first) = rest.split_whitespace().next() else {
            self.error(line, format!("{word} has no number"));
            return None;
        };
        let value = self.finite(line, word, first)?;
        if value < 0.0 && word == "Ns" {
            self.error(line, format!("Ns is {value}, but an exponent cannot be negative"));
            return None;
        }
        Some((line, value + 0.0))
    }

    fn finite(&mut self, line: u32, word: &str, text: &str) -> Option<f32> {
        let shown: String = text.chars().take(40).collect();
        match text.parse::<f32>() {
            Ok(value) if value.is_finite() => Some(value),
            Ok(_) => {
                self.error(line, format!("{word} has the value `{shown}`, which is not finite in 32 bits"));
                None
            }
            Err(_) => {
                self.error(line, format!("{word} has `{shown}` where a number should be"));
                None
            }
        }
    }

    fn model(&mut self, line: u32, rest: &str) -> Stated<u32> {
        let word = rest.split_whitespace().next().unwrap_or_default();
        // Some exporters write it as `2.0`.
        let value = word.parse::<f32>().ok().filter(|v| (0.0..=1000.0).contains(v) && v.fract() == 0.0);
        if value.is_none() {
            let shown: String = word.chars().take(40).collect();
            self.error(line, format!("illum has `{shown}` where the number of an illumination model should be"));
        }
        value.map(|v| (line, v as u32))
    }

    fn map(&mut self, line: u32, word: &str, rest: &str) -> Stated<Map> {
        let map = map::parse(rest);
        if map.file.is_empty() {
            self.error(line, format!("{word} names no file"));
            return None;
        }
        for option in &map.ignored {
            let message = format!("the option `{option}` of {word} is not supported and was ignored");
            self.findings.warn(At::line(self.file.as_str(), line), message);
        }
        Some((line, map))
    }
}
