//! The files that an X3D or VRML97 file refers to, from its syntax alone: for whoever gathers a bundle and so has none yet.
//!
//! The addresses of nodes whose `url` is read are certain. What a prototype makes of the strings that it is given is known only once it is
//! resolved, which needs the files that are being sought; so its strings are guesses: taken where there is such a file, and not missed.

use super::{
    classic, encoding,
    encoding::Encoding,
    json,
    literal::{self, Form},
    syntax::{FieldItem, Item, ProtoBody, Source, Written},
    table,
    value::{FieldType, Value},
    xml,
};
use crate::import::uri;
use kiln_proto::limits;

/// A reference to a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::import) struct Reference {
    /// Where it stands.
    pub(in crate::import) line: u32,
    /// Paths, of which the first that exists counts.
    pub(in crate::import) names: Vec<String>,
    /// Whether the scene lacks something without it.
    pub(in crate::import) certain: bool,
}

/// The references of a file in the order of its lines; nothing where it cannot be read. Cost: that of reading it, linear.
pub(in crate::import) fn references(bytes: &[u8]) -> Vec<Reference> {
    let Ok(decoded) = encoding::decode(bytes) else { return vec![] };
    let text = decoded.text;
    let (read, form) = match decoded.encoding {
        Encoding::Classic => (classic::read(&text, 0), Form::Classic),
        Encoding::Xml => (xml::read(&text, 0), Form::Xml),
        Encoding::Json => (json::read(&text, 0), Form::Json),
    };
    let Ok((_, _, items)) = read else { return vec![] };
    let mut finder = Finder { source: Source { file: 0, text, form }, found: vec![] };
    finder.walk(&items);
    finder.found.sort_by_key(|r| r.line);
    finder.found
}

/// What the strings of a node are to this program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Owner {
    /// Its `url` is read.
    Reads,
    /// A node of the standard whose strings name no file that is read.
    Other,
    /// Perhaps a prototype.
    Unknown,
}

struct Finder {
    source: Source,
    found: Vec<Reference>,
}

impl Finder {
    /// Items within items, without recursion: how deep they stand is the file's choice.
    fn walk(&mut self, items: &[Item]) {
        let mut open: Vec<(&[Item], Owner)> = vec![(items, Owner::Other)];
        while let Some((items, owner)) = open.pop() {
            for item in items {
                if self.found.len() >= limits::BUNDLE_FILES {
                    return;
                }
                match item {
                    Item::Node(node) => open.push((&node.body, owner_of(&node.name))),
                    Item::Declared { nodes, .. } => open.push((nodes, Owner::Other)),
                    Item::Field(field) => match &field.written {
                        Written::Nodes(nodes) => open.push((nodes, owner)),
                        _ => self.field(field, owner),
                    },
                    Item::Proto(proto) => {
                        let defaults = proto.interface.iter().filter_map(|field| field.value.as_ref());
                        for default in defaults {
                            match &default.written {
                                Written::Nodes(nodes) => open.push((nodes, Owner::Other)),
                                _ => self.add(default, false),
                            }
                        }
                        match &proto.body {
                            ProtoBody::Items(items) => open.push((items, Owner::Other)),
                            ProtoBody::Extern(addresses) => self.add(addresses, true),
                        }
                    }
                    Item::Route(_) | Item::Import { .. } | Item::Export { .. } => {}
                }
            }
        }
    }

    fn field(&mut self, field: &FieldItem, owner: Owner) {
        match owner {
            Owner::Reads if &*field.name == "url" => self.add(field, true),
            Owner::Unknown => self.add(field, false),
            _ => {}
        }
    }

    fn add(&mut self, field: &FieldItem, certain: bool) {
        let (Written::Text(span), Some(ty)) = (&field.written, FieldType::parse("MFString")) else { return };
        let Ok((Value::Strings(urls), None)) = literal::parse(ty, span.of(&self.source), self.source.form) else { return };
        let path = |url: &str| uri::decoded(url.trim().split('#').next().unwrap_or_default());
        // Behind data in the file itself nothing is missing.
        let before_data = urls.iter().take_while(|url| !uri::is_data(url.trim()));
        let certain = certain && before_data.clone().count() == urls.len();
        let names: Vec<String> =
            before_data.filter(|url| !url.starts_with("urn:")).map(|url| path(url)).filter(|n| !n.is_empty()).collect();
        if !names.is_empty() {
            self.found.push(Reference { line: field.place.line, names, certain });
        }
    }
}

fn owner_of(name: &str) -> Owner {
    match table::lookup(name) {
        Some(kind) if kind.reads_url() => Owner::Reads,
        Some(_) => Owner::Other,
        None => Owner::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(text: &str) -> Vec<(u32, String, bool)> {
        references(text.as_bytes()).into_iter().map(|r| (r.line, r.names.join("|"), r.certain)).collect()
    }

    #[test]
    fn every_encoding_names_its_files() {
        let classic = "#X3D V3.3 utf8
EXTERNPROTO Lamp [ field MFString url ] [ \"urn:x\" \"lib/lamps.x3dv#Lamp\" ]
PROTO Sign [ field MFString face \"default.png\" ] { Shape { appearance Appearance { texture ImageTexture { url IS face } } } }
Group { children [ Inline { url [ \"http://example.com/a%20b.wrl\" \"a.wrl\" ] }
Shape { appearance Appearance { texture MultiTexture { texture [ ImageTexture { url \"wall.png\" } MovieTexture { url \"film.mpg\" } ] } } } ] }
Sign { face \"mine.png\" }
EnvironmentLight { specularTexture ImageCubeMapTexture { url \"sky.hdr\" } }
ImageTexture { url \"data:image/png;base64,AAAA\" } Anchor { url \"next.wrl\" }
KambiInline { url \"castle.x3d\" }";
        let expected = [
            (2, "lib/lamps.x3dv", true),
            (3, "default.png", false),
            (4, "http://example.com/a b.wrl|a.wrl", true),
            (5, "wall.png", true),
            (6, "mine.png", false),
            (7, "sky.hdr", true),
            (9, "castle.x3d", true),
        ];
        assert_eq!(found(classic), expected.map(|(line, names, certain)| (line, names.to_owned(), certain)));
        let xml = "<X3D><Scene>\n<Inline url='\"a.x3d\"'/>\n<Shape><Appearance><ImageTexture url='\"t.png\"'/></Appearance></Shape></Scene></X3D>";
        assert_eq!(found(xml), [(2, "a.x3d".to_owned(), true), (3, "t.png".to_owned(), true)]);
        let json = "{ \"X3D\": { \"Scene\": { \"-children\": [\n{ \"Inline\": { \"@url\": [\"a.x3d\"] } } ] } } }";
        assert_eq!(found(json), [(2, "a.x3d".to_owned(), true)]);
        assert_eq!(found("#X3D V3.3 utf8\nInline { url [ "), []);
    }
}
