//! PROTO and EXTERNPROTO.

use super::{Reader, lexer::Kind};
use crate::import::x3d::{
    limits::MAX_DEPTH,
    syntax::{FieldItem, InterfaceItem, Item, ProtoBody, ProtoItem, SyntaxError, Written},
    table::Access,
    value::FieldType,
};
use std::rc::Rc;

impl Reader<'_> {
    /// `PROTO name [interface] { body }` or `EXTERNPROTO name [interface] addresses`.
    pub(super) fn proto(&mut self, depth: u16) -> Result<Item, SyntaxError> {
        let place = self.place();
        if depth >= MAX_DEPTH {
            return Err(SyntaxError { place, message: format!("more than {MAX_DEPTH} nodes and prototypes inside one another") });
        }
        let external = self.lexer.take()? == "EXTERNPROTO";
        let name: Box<str> = self.name("the name of a prototype")?.into();
        if !self.lexer.take_mark(b'[')? {
            return self.lexer.expected("`[` and the fields of the prototype");
        }
        let mut interface = vec![];
        while !self.lexer.take_mark(b']')? {
            interface.push(self.interface(external, depth)?);
        }
        let body = if external {
            let place = self.place();
            ProtoBody::Extern(FieldItem::new(place, "url", self.addresses()?))
        } else {
            ProtoBody::Items(self.body(depth)?)
        };
        Ok(Item::Proto(Rc::new(ProtoItem { place, name, interface, body })))
    }

    fn body(&mut self, depth: u16) -> Result<Vec<Item>, SyntaxError> {
        if !self.lexer.take_mark(b'{')? {
            return self.lexer.expected("`{` and the nodes of the prototype");
        }
        let mut items = vec![];
        while !self.lexer.take_mark(b'}')? {
            self.statement(&mut items, depth + 1)?;
        }
        Ok(items)
    }

    fn addresses(&mut self) -> Result<Written, SyntaxError> {
        match self.lexer.peek().kind {
            Kind::String | Kind::Mark(b'[') => self.value(MAX_DEPTH),
            _ => self.lexer.expected("the addresses of the prototype"),
        }
    }

    /// `access type name value`.
    fn interface(&mut self, external: bool, depth: u16) -> Result<InterfaceItem, SyntaxError> {
        let place = self.place();
        let Some(access) = Access::parse(self.lexer.peek_text()) else { return self.lexer.expected("the access of a field, or `]`") };
        self.lexer.take()?;
        let Some(ty) = FieldType::parse(self.lexer.peek_text()) else { return self.lexer.expected("the type of a field") };
        self.lexer.take()?;
        let name = self.name("the name of a field")?;
        let at = self.place();
        let value = if external || !access.has_value() { None } else { Some(FieldItem::new(at, name, self.value(depth + 1)?)) };
        Ok(InterfaceItem { place, name: name.into(), access, ty, value })
    }
}
