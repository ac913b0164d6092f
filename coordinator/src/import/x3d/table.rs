//! The nodes of X3D and their fields: one table, in the notation of the standard, for all encodings.
//!
//! ```text
//! abstract Light
//!   SFFloat        [in,out] intensity 1
//! SpotLight in children : Light Child
//!   SFFloat angle  [in,out] cutOffAngle 0.7854
//! Script in children skipped : Child
//! ```
//! A line at the margin is a node: its name, the field it goes to by default (its `containerField`), whether the importer skips it, and
//! what it inherits. An indented line is a field: type, `angle` where the file's unit of angles applies, access, name with other names
//! behind `|`, default (`since 3.3` another one); in a list whose places mean something, behind `else`, the node that stands in for one
//! that is skipped. Kept as text so that it can be laid beside the standard line by line; the alternative, constructors in code, is checked
//! by the compiler and not readable by anyone. A test checks the text instead.

mod appearance;
mod core;
mod geometry;
mod humanoid;
mod interpolation;
mod lighting;
mod navigation;
mod skipped;

use super::{
    literal::{self, Form},
    value::{FieldType, Store, Value},
};
use std::{collections::BTreeMap, fmt, sync::OnceLock};

/// The parts of the table.
const PARTS: [&str; 8] = [
    core::NODES,
    geometry::NODES,
    appearance::NODES,
    lighting::NODES,
    navigation::NODES,
    interpolation::NODES,
    humanoid::NODES,
    skipped::NODES,
];

/// Who may touch a field, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Access {
    /// The file: `initializeOnly`, `field`.
    Initialize,
    /// Events: `inputOnly`, `eventIn`.
    Input,
    /// Nobody; it sends: `outputOnly`, `eventOut`.
    Output,
    /// All: `inputOutput`, `exposedField`.
    InputOutput,
}

impl Access {
    /// By its name in the standard, in XML and in VRML97, or by its sign in the table.
    pub(super) fn parse(word: &str) -> Option<Self> {
        match word {
            "initializeOnly" | "field" | "[]" => Some(Self::Initialize),
            "inputOnly" | "eventIn" | "[in]" => Some(Self::Input),
            "outputOnly" | "eventOut" | "[out]" => Some(Self::Output),
            "inputOutput" | "exposedField" | "[in,out]" => Some(Self::InputOutput),
            _ => None,
        }
    }

    /// Its name in the standard.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Initialize => "initializeOnly",
            Self::Input => "inputOnly",
            Self::Output => "outputOnly",
            Self::InputOutput => "inputOutput",
        }
    }

    /// Whether a file may give such a field a value.
    pub(super) fn has_value(self) -> bool {
        matches!(self, Self::Initialize | Self::InputOutput)
    }

    /// Whether it can be where a ROUTE begins.
    pub(super) fn sends(self) -> bool {
        matches!(self, Self::Output | Self::InputOutput)
    }

    /// Whether it can be where a ROUTE ends.
    pub(super) fn receives(self) -> bool {
        matches!(self, Self::Input | Self::InputOutput)
    }
}

/// A field of a type of nodes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: &'static str,
    /// Names of other versions and viewers.
    aliases: Vec<&'static str>,
    pub(super) ty: FieldType,
    /// Whether its numbers are angles, in the file's unit.
    pub(super) angle: bool,
    pub(super) access: Access,
    /// In metres and radians.
    pub(super) default: Value,
    /// The default in files of this version (times ten) and later, where the standard has changed it.
    pub(super) since: Option<(u32, Value)>,
    /// Type of the empty node that takes the place of one that is skipped, where other fields count the places of this list.
    pub(super) stand_in: Option<&'static str>,
}

/// A type of nodes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct NodeType {
    pub(super) name: &'static str,
    /// The field that such a node goes to in XML where nothing is said.
    pub(super) container: &'static str,
    /// Known, but nothing here knows how to bake it.
    pub(super) skipped: bool,
    pub(super) fields: Vec<Field>,
}

impl NodeType {
    /// Whether nodes of this type bring in another file.
    pub(super) fn is_inline(&self) -> bool {
        matches!(self.name, "Inline" | "KambiInline")
    }

    /// Whether the file at the `url` of nodes of this type is read.
    pub(super) fn reads_url(&self) -> bool {
        self.is_inline() || matches!(self.name, "ImageTexture" | "ImageCubeMapTexture")
    }

    /// A field by its name, as files write it, and its index.
    pub(super) fn field(&self, name: &str) -> Option<(u16, &Field)> {
        let found = self.fields.iter().position(|f| f.name == name || f.aliases.contains(&name))?;
        Some((found as u16, &self.fields[found]))
    }

    /// A field by its name in capitals or not, as pages of HTML write it.
    pub(super) fn field_in_any_case(&self, name: &str) -> Option<(u16, &Field)> {
        let found = self.fields.iter().position(|f| f.name.eq_ignore_ascii_case(name))?;
        Some((found as u16, &self.fields[found]))
    }

    /// A field by the name that a ROUTE uses for an event of it (`set_NAME`, `NAME_changed` or the name itself), and its index.
    pub(super) fn event(&self, name: &str) -> Option<(u16, &Field)> {
        let exposed = |n: Option<&str>| self.field(n?).filter(|(_, f)| f.access == Access::InputOutput);
        self.field(name).or_else(|| exposed(name.strip_prefix("set_"))).or_else(|| exposed(name.strip_suffix("_changed")))
    }
}

fn table() -> &'static BTreeMap<&'static str, NodeType> {
    static TABLE: OnceLock<BTreeMap<&'static str, NodeType>> = OnceLock::new();
    // The text is part of the program and a test reads it, so there is no error left to report here.
    TABLE.get_or_init(|| read(&PARTS).unwrap_or_default())
}

/// The node type of this name.
pub(super) fn lookup(name: &str) -> Option<&'static NodeType> {
    table().get(name)
}

/// The node type of this name in capitals or not, as pages of HTML write it.
pub(super) fn lookup_in_any_case(name: &str) -> Option<&'static NodeType> {
    static FOLDED: OnceLock<BTreeMap<String, &'static NodeType>> = OnceLock::new();
    let folded = FOLDED.get_or_init(|| table().values().map(|kind| (kind.name.to_ascii_lowercase(), kind)).collect());
    folded.get(&name.to_ascii_lowercase()).copied()
}

/// All of them, by name.
#[cfg(test)]
pub(super) fn all() -> impl Iterator<Item = &'static NodeType> {
    table().values()
}

/// A line of the table that says nothing.
#[derive(Debug, PartialEq, Eq)]
struct BadLine(String);

impl fmt::Display for BadLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "not a line of the node table: {}", self.0)
    }
}

fn read(parts: &[&'static str]) -> Result<BTreeMap<&'static str, NodeType>, BadLine> {
    let mut types = BTreeMap::<&str, NodeType>::new();
    let mut abstracts = BTreeMap::<&str, NodeType>::new();
    let mut open: Option<(bool, NodeType)> = None;
    let mut close = |open: Option<(bool, NodeType)>, abstracts: &mut BTreeMap<&str, NodeType>| match open {
        Some((true, t)) => abstracts.insert(t.name, t).is_none(),
        Some((false, t)) => types.insert(t.name, t).is_none(),
        None => true,
    };
    for line in parts.iter().flat_map(|p| p.lines()).filter(|l| !l.trim().is_empty()) {
        let bad = || BadLine(line.to_owned());
        if line.starts_with(' ') {
            let field = field_line(line).ok_or_else(bad)?;
            add(&mut open.as_mut().ok_or_else(bad)?.1.fields, field);
        } else {
            if !close(open.take(), &mut abstracts) {
                return Err(bad());
            }
            open = Some(node_line(line, &abstracts).ok_or_else(bad)?);
        }
    }
    if close(open, &mut abstracts) { Ok(types) } else { Err(BadLine("a name twice at the end".to_owned())) }
}

/// A line at the margin, and whether it is an abstract type.
fn node_line(line: &'static str, abstracts: &BTreeMap<&str, NodeType>) -> Option<(bool, NodeType)> {
    let (head, bases) = line.split_once(':').unwrap_or((line, ""));
    let words: Vec<&'static str> = head.split_whitespace().collect();
    let (is_abstract, name, container, skipped) = match words.as_slice() {
        ["abstract", name] => (true, *name, "", false),
        [name, "in", container] => (false, *name, *container, false),
        [name, "in", container, "skipped"] => (false, *name, *container, true),
        _ => return None,
    };
    let mut fields = vec![];
    for base in bases.split_whitespace() {
        for field in &abstracts.get(base)?.fields {
            add(&mut fields, field.clone());
        }
    }
    Some((is_abstract, NodeType { name, container, skipped, fields }))
}

/// Adds a field, in place of an inherited one of its name.
fn add(fields: &mut Vec<Field>, field: Field) {
    match fields.iter_mut().find(|f| f.name == field.name) {
        Some(inherited) => *inherited = field,
        None => fields.push(field),
    }
}

fn field_line(line: &'static str) -> Option<Field> {
    let (ty, rest) = line.trim().split_once(' ')?;
    let ty = FieldType::parse(ty)?;
    let rest = rest.trim_start();
    let (angle, rest) = rest.strip_prefix("angle ").map_or((false, rest), |r| (true, r.trim_start()));
    let (access, rest) = rest.split_once(' ')?;
    let access = Access::parse(access)?;
    let rest = rest.trim_start();
    let (names, default) = rest.split_once(' ').unwrap_or((rest, ""));
    let mut names = names.split('|');
    let name = names.next()?;
    let (default, stand_in) = default.split_once(" else ").map_or((default, None), |(d, s)| (d, Some(s)));
    let (default, since) = default.split_once(" since ").map_or((default, None), |(d, s)| (d, Some(s)));
    let since = match since {
        Some(text) => {
            let (version, value) = text.split_once(' ')?;
            Some((version.replace('.', "").parse().ok()?, default_value(ty, value)?))
        }
        None => None,
    };
    Some(Field { name, aliases: names.collect(), ty, angle, access, default: default_value(ty, default)?, since, stand_in })
}

fn default_value(ty: FieldType, text: &str) -> Option<Value> {
    match text.trim() {
        "" | "NULL" | "[]" => Some(ty.zero()),
        _ if ty.store() == Store::Nodes => None,
        text => literal::parse(ty, text, Form::Classic).ok().filter(|(_, remark)| remark.is_none()).map(|(value, _)| value),
    }
}

#[cfg(test)]
mod tests;
