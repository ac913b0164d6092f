//! Materials as an MTL text states them, each value with its line.
//!
//! Read here and not with a library: those keep no lines, give up at the first fault, want three numbers where the format allows one, and
//! take options of `map_Kd` for part of the file name.

use super::{
    map::{self, Map},
    raw::{Library, Number, RawMaterial, Role, Stated, role},
    text,
};
use crate::import::{
    BundlePath,
    findings::{At, Findings},
};
use kiln_proto::{limits, units::Rgb};

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
        Some((name.to_owned(), RawMaterial::new(self.file, line)))
    }

    fn define(&mut self, library: &mut Library, name: String, material: RawMaterial) {
        if let Some(old) = library.get(&name) {
            let message = format!("the material `{name}` was already defined at {}:{}; this definition counts", old.file, old.line);
            self.findings.warn(At::line(self.file.as_str(), material.line), message);
        }
        library.insert(name, material);
    }

    fn statement(&mut self, line: u32, word: &str, rest: &str, m: &mut RawMaterial) {
        let number = match word {
            "Kd" => return m.diffuse = self.colour(line, word, rest).or(m.diffuse),
            "Ks" => return m.specular = self.colour(line, word, rest).or(m.specular),
            "Ke" => return m.emission = self.emission(line, rest).or(m.emission),
            "Tf" => return m.filter = self.colour(line, word, rest).or(m.filter),
            "illum" => return m.model = self.model(line, rest).or(m.model),
            "Ns" => Number::Exponent,
            "d" => Number::Opacity,
            "Tr" => Number::Transparency,
            "Ni" => Number::Refraction,
            "Pr" => Number::Roughness,
            "Pm" => Number::Metallic,
            "Pc" => Number::Coat,
            "Pcr" => Number::CoatRoughness,
            // Ambient light is what the bake computes; the rest concerns filtering.
            "Ka" | "map_Ka" | "map_ka" | "sharpness" | "map_aat" => return,
            other => return self.other(line, other, rest, m),
        };
        if let Some(value) = self.number(line, number, word, rest) {
            m.set_number(number, line, value);
        }
    }

    /// Textures, and what is not known.
    fn other(&mut self, line: u32, word: &str, rest: &str, m: &mut RawMaterial) {
        if let Some(role) = role(word) {
            if let Some(map) = self.map(line, word, role, rest) {
                m.set_map(role, line, map);
            }
            return;
        }
        let shown: String = word.chars().take(40).collect();
        let what = match word {
            "Ps" | "map_Ps" => " (sheen)",
            "aniso" | "anisor" => " (anisotropy)",
            "disp" | "map_disp" => " (displacement)",
            "refl" => " (a picture of the surroundings, which the bake computes)",
            _ => "",
        };
        self.findings.warn_once(At::line(self.file.as_str(), line), &shown, format!("`{shown}`{what} is not supported and was ignored"));
    }

    /// What a material emits, which has an end.
    fn emission(&mut self, line: u32, rest: &str) -> Stated<Rgb> {
        let stated = self.colour(line, "Ke", rest)?;
        let most = stated.1.max_channel();
        if most > limits::BRIGHTEST {
            self.error(line, format!("Ke is {most:e}; at most {:e} is possible", limits::BRIGHTEST));
            return None;
        }
        Some(stated)
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
            [r, g, b, _] => {
                let message = format!("{word} has a fourth number, which was ignored: opacity is `d` (said once)");
                self.findings.warn_once(At::line(self.file.as_str(), line), "fourth", message);
                Rgb::new(*r, *g, *b)
            }
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

    fn number(&mut self, line: u32, number: Number, word: &str, rest: &str) -> Option<f32> {
        let rest = if number == Number::Opacity { rest.strip_prefix("-halo").unwrap_or(rest) } else { rest };
        let Some(first) = rest.split_whitespace().next() else {
            self.error(line, format!("{word} has no number"));
            return None;
        };
        let value = self.finite(line, word, first)?;
        if number == Number::Exponent && value < 0.0 {
            self.findings
                .warn(At::line(self.file.as_str(), line), format!("Ns is {value}, but an exponent cannot be negative; it was taken as 0"));
            return Some(0.0);
        }
        let is_share = !matches!(number, Number::Exponent | Number::Refraction);
        if is_share && !(0.0..=1.0).contains(&value) {
            self.findings.warn(At::line(self.file.as_str(), line), format!("{word} is {value}; it was brought to [0, 1]"));
            return Some(value.clamp(0.0, 1.0));
        }
        Some(value + 0.0)
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

    fn map(&mut self, line: u32, word: &str, role: Role, rest: &str) -> Option<Map> {
        let mut map = map::parse(rest);
        if map.file.is_empty() {
            self.findings.warn(At::line(self.file.as_str(), line), format!("{word} names no file and was ignored"));
            return None;
        }
        let is_number = matches!(role, Role::Exponent | Role::Opacity | Role::Roughness | Role::Metallic | Role::Bump);
        if map.channel.is_some() && !is_number {
            map.ignored.push("-imfchan".to_owned());
        }
        if map.range.is_some() && !is_number {
            map.ignored.push("-mm".to_owned());
        }
        if map.bump.is_some_and(|b| b != 1.0) && !matches!(role, Role::Bump | Role::Normal) {
            map.ignored.push("-bm".to_owned());
        }
        let is_colour = !is_number && role != Role::Normal;
        if let Some(space) = map.space.take().filter(|space| space.eq_ignore_ascii_case("srgb") != is_colour) {
            map.ignored.push(format!("-colorspace {space}"));
        }
        for option in &map.ignored {
            let message = format!("the option `{option}` of {word} is not supported and was ignored");
            self.findings.warn(At::line(self.file.as_str(), line), message);
        }
        Some(map)
    }
}
