//! ClassicVRML (ISO/IEC 19776-2) and VRML97: a recursive reader that needs no table.
//!
//! The standard's grammar asks the type of a field to know where its value ends. It need not: a value is a bracket, one string, one
//! boolean, a run of numbers, or a node, and the name of the next field is none of these. So fields of unknown nodes and of prototypes
//! that are not there are passed by as well as any.

mod lexer;
mod proto;

use super::{
    document::Place,
    limits::{MAX_DEPTH, MAX_NODES},
    syntax::{FieldItem, Item, NodeItem, RouteItem, Span, SyntaxError, Unit, Written},
    table::Access,
    value::FieldType,
};
use lexer::{Kind, Lexer};

/// What a text says: its version (times ten), its units and its statements.
pub(super) type Read = (u32, Vec<Unit>, Vec<Item>);

/// Reads a text. Cost: one pass.
///
/// # Errors
/// The first place where it is not ClassicVRML.
pub(super) fn read(text: &str, file: u32) -> Result<Read, SyntaxError> {
    let mut reader = Reader { lexer: Lexer::new(text, file)?, nodes: 0, units: vec![] };
    let mut items = vec![];
    while reader.lexer.peek().kind != Kind::End {
        reader.statement(&mut items, 0)?;
    }
    Ok((version(text), reader.units, items))
}

/// The version in a header such as `#X3D V3.2 utf8`.
fn version(text: &str) -> u32 {
    let line = text.trim_start().lines().next().unwrap_or_default();
    let number = line.split_whitespace().nth(1).and_then(|w| w.strip_prefix(['V', 'v']));
    number.map_or(0, super::parse_version)
}

struct Reader<'a> {
    lexer: Lexer<'a>,
    nodes: usize,
    units: Vec<Unit>,
}

impl<'a> Reader<'a> {
    /// One statement of a file or of the body of a prototype.
    fn statement(&mut self, items: &mut Vec<Item>, depth: u16) -> Result<(), SyntaxError> {
        let place = self.lexer.place();
        match self.lexer.peek_text() {
            "PROFILE" => {
                self.lexer.take()?;
                self.name("a name")?;
            }
            "COMPONENT" => {
                self.lexer.take()?;
                self.name("a name")?;
                // `Shape:4` is one word; X_ITE writes `Shape : 4`.
                while self.lexer.peek_text().starts_with(':') || self.lexer.peek().kind == Kind::Number {
                    self.lexer.take()?;
                }
            }
            "META" => {
                self.lexer.take()?;
                self.string()?;
                self.string()?;
            }
            "UNIT" => {
                self.lexer.take()?;
                let category = self.name("the category of a unit")?.into();
                self.name("the name of a unit")?;
                self.units.push(Unit { place, category, factor: self.lexer.take()?.into() });
            }
            "IMPORT" => {
                self.lexer.take()?;
                let (inline, exported) = self.dotted()?;
                let local = self.renamed(&exported)?;
                items.push(Item::Import { place, inline, exported, local });
            }
            "EXPORT" => {
                self.lexer.take()?;
                let local: Box<str> = self.name("a name")?.into();
                let exported = self.renamed(&local)?;
                items.push(Item::Export { place, local, exported });
            }
            _ if self.common(items, depth)? => {}
            _ => items.push(Item::Node(self.node(depth)?)),
        }
        Ok(())
    }

    /// The statements that may also stand in the body of a node; whether there was one.
    fn common(&mut self, items: &mut Vec<Item>, depth: u16) -> Result<bool, SyntaxError> {
        let place = self.lexer.place();
        match self.lexer.peek_text() {
            "ROUTE" => {
                self.lexer.take()?;
                let from = self.dotted()?;
                if self.lexer.peek_text() != "TO" {
                    return self.lexer.expected("`TO`");
                }
                self.lexer.take()?;
                items.push(Item::Route(RouteItem { place, from, to: self.dotted()? }));
            }
            "PROTO" | "EXTERNPROTO" => items.push(self.proto(depth)?),
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// A node or a `USE`.
    fn node(&mut self, depth: u16) -> Result<NodeItem, SyntaxError> {
        let mut place = self.lexer.place();
        if depth >= MAX_DEPTH {
            return Err(SyntaxError { place, message: format!("more than {MAX_DEPTH} nodes inside one another") });
        }
        self.nodes += 1;
        if self.nodes > MAX_NODES {
            return Err(SyntaxError { place, message: format!("more than {MAX_NODES} nodes") });
        }
        let mut node = NodeItem { place, name: "".into(), def: None, usage: None, container: None, body: vec![] };
        if self.lexer.peek_text() == "USE" {
            self.lexer.take()?;
            node.usage = Some(self.label()?.into());
            return Ok(node);
        }
        if self.lexer.peek_text() == "DEF" {
            self.lexer.take()?;
            node.def = Some(self.label()?.into());
            place = self.lexer.place();
        }
        node.place = place;
        node.name = self.name("a statement or the type of a node")?.into();
        if !self.lexer.take_mark(b'{')? {
            return self.lexer.expected(&format!("`{{` behind `{}`", super::literal::shown(&node.name)));
        }
        while !self.lexer.take_mark(b'}')? {
            self.element(&mut node, depth)?;
        }
        Ok(node)
    }

    /// A field or a statement in the body of a node.
    fn element(&mut self, node: &mut NodeItem, depth: u16) -> Result<(), SyntaxError> {
        if self.lexer.peek().kind == Kind::End {
            let begun = format!("`}}` of `{}` in line {}", super::literal::shown(&node.name), node.place.line);
            return self.lexer.expected(&begun);
        }
        if self.common(&mut node.body, depth)? {
            return Ok(());
        }
        let place = self.lexer.place();
        let name = self.name("the name of a field")?;
        let access = Access::parse(name).filter(|_| FieldType::parse(self.lexer.peek_text()).is_some());
        if let Some(access) = access {
            self.lexer.take()?;
            self.name("the name of a field")?;
            let value = if access.has_value() || self.lexer.peek_text() == "IS" { Some(self.value(depth)?) } else { None };
            let nodes = if let Some(Written::Nodes(nodes)) = value { nodes } else { vec![] };
            node.body.push(Item::Declared { place, nodes });
            return Ok(());
        }
        let place = self.lexer.place();
        let written = self.value(depth)?;
        node.body.push(Item::Field(FieldItem::new(place, name, written)));
        Ok(())
    }

    /// The value of a field.
    fn value(&mut self, depth: u16) -> Result<Written, SyntaxError> {
        let token = self.lexer.peek().clone();
        match token.kind {
            Kind::Mark(b'[') => self.list(depth),
            Kind::String => {
                self.lexer.take()?;
                Ok(Written::Text(Span::Range(token.range)))
            }
            Kind::Number => {
                let mut end = token.range.end;
                while self.lexer.peek().kind == Kind::Number {
                    end = self.lexer.peek().range.end;
                    self.lexer.take()?;
                }
                Ok(Written::Text(Span::Range(token.range.start..end)))
            }
            Kind::Name => match self.lexer.peek_text() {
                "NULL" => {
                    self.lexer.take()?;
                    Ok(Written::Nodes(vec![]))
                }
                "IS" => {
                    self.lexer.take()?;
                    Ok(Written::Is(self.name("the name of a field of the prototype")?.into()))
                }
                word if is_boolean(word) => {
                    self.lexer.take()?;
                    Ok(Written::Text(Span::Range(token.range)))
                }
                _ => Ok(Written::Nodes(vec![Item::Node(self.node(depth + 1)?)])),
            },
            Kind::Mark(_) | Kind::End => self.lexer.expected("the value of a field"),
        }
    }

    /// A value in brackets.
    fn list(&mut self, depth: u16) -> Result<Written, SyntaxError> {
        self.lexer.take()?;
        let start = self.lexer.peek().range.start;
        if self.lexer.peek().kind == Kind::Name && !is_boolean(self.lexer.peek_text()) {
            let mut items = vec![];
            while !self.lexer.take_mark(b']')? {
                if self.lexer.peek_text() == "NULL" {
                    self.lexer.take()?;
                } else if !self.common(&mut items, depth)? {
                    items.push(Item::Node(self.node(depth + 1)?));
                }
            }
            return Ok(Written::Nodes(items));
        }
        while matches!(self.lexer.peek().kind, Kind::Number | Kind::String) || is_boolean(self.lexer.peek_text()) {
            self.lexer.take()?;
        }
        let end = self.lexer.peek().range.start;
        if self.lexer.take_mark(b']')? { Ok(Written::Text(Span::Range(start..end))) } else { self.lexer.expected("`]` or another value") }
    }

    fn name(&mut self, what: &str) -> Result<&'a str, SyntaxError> {
        if self.lexer.peek().kind == Kind::Name { self.lexer.take() } else { self.lexer.expected(what) }
    }

    /// A name of a node, which exporters also begin with a digit.
    fn label(&mut self) -> Result<&'a str, SyntaxError> {
        if matches!(self.lexer.peek().kind, Kind::Name | Kind::Number) { self.lexer.take() } else { self.lexer.expected("a name") }
    }

    fn string(&mut self) -> Result<&'a str, SyntaxError> {
        if self.lexer.peek().kind == Kind::String { self.lexer.take() } else { self.lexer.expected("a string") }
    }

    /// `node.field`; names of nodes may have dots.
    fn dotted(&mut self) -> Result<(Box<str>, Box<str>), SyntaxError> {
        let place = self.lexer.place();
        let text = self.label()?;
        match text.rsplit_once('.') {
            Some((node, field)) if !node.is_empty() && !field.is_empty() => Ok((node.into(), field.into())),
            _ => Err(SyntaxError { place, message: format!("expected NODE.FIELD, found `{}`", super::literal::shown(text)) }),
        }
    }

    /// `AS name`, or the same name.
    fn renamed(&mut self, name: &str) -> Result<Box<str>, SyntaxError> {
        if self.lexer.peek_text() != "AS" {
            return Ok(name.into());
        }
        self.lexer.take()?;
        Ok(self.label()?.into())
    }

    fn place(&mut self) -> Place {
        self.lexer.place()
    }
}

/// The standard writes TRUE and FALSE, hands write anything.
fn is_boolean(word: &str) -> bool {
    word.eq_ignore_ascii_case("true") || word.eq_ignore_ascii_case("false")
}

#[cfg(test)]
mod tests;
