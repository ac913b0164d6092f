//! ClassicVRML (ISO/IEC 19776-2).

use super::{Fields, Writer, literal};
use crate::import::x3d::{
    document::{NodeId, Route},
    table::Field,
};

impl Writer<'_> {
    pub(super) fn classic(&mut self, version: u32, routes: &[&Route]) {
        self.out.push_str(&format!("#X3D V{}.{} utf8\nPROFILE Full\n", version / 10, version % 10));
        for root in &self.document.roots {
            self.out.push('\n');
            self.classic_node(*root);
        }
        self.out.extend((!routes.is_empty()).then_some('\n'));
        for route in routes {
            let [(from, out), (to, into)] = self.ends(route);
            self.line(&format!("ROUTE {from}.{out} TO {to}.{into}"));
        }
    }

    /// A node, from the place where its line goes on to the end of a line.
    fn classic_node(&mut self, id: NodeId) {
        if let Some(name) = self.usage(id) {
            self.out.push_str(&format!("USE {name}\n"));
            return;
        }
        if let Some(name) = self.names.get(id) {
            self.out.push_str(&format!("DEF {name} "));
        }
        self.out.push_str(self.document.nodes[id.0 as usize].kind.name);
        let Fields { simple, nodes } = self.fields(id);
        if simple.is_empty() && nodes.is_empty() {
            self.out.push_str(" {}\n");
            return;
        }
        self.out.push_str(" {\n");
        self.depth += 1;
        for (field, value) in simple {
            let (text, lost) = literal::sayable(&literal::elements(field.ty, value, true, &"  ".repeat(self.depth + 1)));
            self.lost += lost;
            let text = if literal::is_list(field.ty) { format!("{} [{text}]", field.name) } else { format!("{} {text}", field.name) };
            self.line(&text);
        }
        for (field, ids) in nodes {
            self.classic_children(field, ids);
        }
        self.depth -= 1;
        self.line("}");
    }

    fn classic_children(&mut self, field: &Field, ids: &[NodeId]) {
        self.indent();
        self.out.push_str(field.name);
        if !field.ty.many {
            self.out.push(' ');
            ids.iter().for_each(|id| self.classic_node(*id));
            return;
        }
        self.out.push_str(" [\n");
        self.depth += 1;
        for id in ids {
            self.indent();
            self.classic_node(*id);
        }
        self.depth -= 1;
        self.line("]");
    }
}
