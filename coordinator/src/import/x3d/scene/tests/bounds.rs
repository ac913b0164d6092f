//! A few hundred bytes may stand for millions of things: what that comes to is counted before it is made.

use super::*;
use crate::import::{
    findings::Findings,
    x3d::{
        scene::{environment::MOST, walk::World},
        testing::classic,
    },
};

/// A node that stands 2^levels times in this group.
fn many(name: &str, node: &str, levels: u32) -> String {
    let mut text = format!("DEF {name}0 Group {{ children {node} }}\n");
    for level in 1..=levels {
        let before = level - 1;
        text += &format!("DEF {name}{level} Group {{ children [ USE {name}{before} USE {name}{before} ] }}\n");
    }
    // Only the last one stands in the scene; the others would double it.
    format!("Switch {{ whichChoice {levels} children [ {text} ] }}\n")
}

fn error(text: &str) -> String {
    let outcome = import("a.x3dv", &format!("#X3D V3.3 utf8\n{text}"), &ImportOptions::default());
    outcome.map(|_| "it was imported").unwrap_err()[0].clone()
}

#[test]
fn pairs_of_shapes_and_lights_are_counted_before_they_are_listed() {
    let triangle = "Shape { geometry TriangleSet { coord Coordinate { point [ 0 0 0 1 0 0 0 1 0 ] } } }";
    let text = many("L", "DirectionalLight { }", 13) + &many("S", triangle, 12);
    assert!(text.len() < 2_500);
    assert!(error(&text).contains("more than 16777216 pairs of a shape and a light"), "{}", error(&text));
    // As many lights that shine on everything are no matter.
    let global = many("L", "DirectionalLight { global TRUE }", 8) + &many("S", triangle, 8);
    assert!(import("a.x3dv", &format!("#X3D V3.3 utf8\n{global}"), &ImportOptions::default()).is_ok());
}

#[test]
fn shapes_that_receive_from_many_lights_are_counted_too() {
    let lamps: String = (0..600).map(|i| format!("DEF P{i} PointLight {{ }} ")).collect();
    let uses: String = (0..600).map(|i| format!("USE P{i} ")).collect();
    let triangle = format!(
        "Shape {{ appearance Appearance {{ receiveShadows [ {uses} ] }} geometry TriangleSet {{ coord Coordinate {{ point [ 0 0 0 1 0 0 0 1 0 ] }} }} }}"
    );
    assert!(error(&(lamps + &many("S", &triangle, 15))).contains("pairs of a shape and a light"));
}

#[test]
fn inlines_of_other_formats_are_counted_before_they_are_read() {
    let main = format!("#X3D V3.3 utf8\nPointLight {{ }} {}", many("I", "Inline { url \"a.obj\" }", 17));
    let files: [(&str, &[u8]); 2] = [("a.x3dv", main.as_bytes()), ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")];
    let errors = import_files(&files, &ImportOptions::default()).unwrap_err();
    assert!(errors.iter().any(|e| e.contains("65535 shapes or inlined files")), "{errors:?}");
}

#[test]
fn layers_and_coordinate_sets_have_a_number_that_counts() {
    let textures = "PixelTexture { image 1 1 1 0x80 } ".repeat(20);
    let lists = "TextureCoordinate { point [ 0 0 1 0 0 1 ] } ".repeat(20);
    let text = format!(
        "#X3D V3.3 utf8\nPointLight {{ }} Shape {{ appearance Appearance {{ material Material {{ }} texture MultiTexture {{ texture [ {textures} ] }} }}
         geometry TriangleSet {{ coord Coordinate {{ point [ 0 0 0 1 0 0 0 1 0 ] }} texCoord MultiTextureCoordinate {{ texCoord [ {lists} ] }} }} }}"
    );
    let (scene, warnings) = import("a.x3dv", &text, &ImportOptions::default()).unwrap();
    assert_eq!((scene.materials[0].textures().count(), scene.surfaces[0].uv_sets.len()), (16, 8));
    for said in ["more than 16 textures; the first 16 count", "became automatic: 13, the first here"] {
        assert!(warnings.iter().any(|w| w.contains(said)), "{warnings:?}");
    }
}

/// What is passed over costs time like what is visited.
#[test]
fn hidden_entries_of_lists_are_counted_too() {
    let groups = "Group { } ".repeat(1000);
    for node in [
        format!("LayerSet {{ order 1001 layers [ {} ] }}", "Layer { } ".repeat(1000)),
        format!("LayerSet {{ order [ {} ] }}", "7 ".repeat(1000)),
        format!("CADLayer {{ visible [ {} ] children [ {groups} ] }}", "FALSE ".repeat(1000)),
        format!("Switch {{ whichChoice 999 children [ {groups} ] }}"),
    ] {
        let found = error(&many("N", &node, 11));
        assert!(found.contains("stands for more than 1048576 nodes"), "{found}: {}", &node[..20]);
    }
}

/// One more than may be is enough to know.
#[test]
fn environments_beyond_those_that_count_are_not_kept() {
    let document = classic(&many("E", "EnvironmentLight { }", 10)).clean();
    let mut findings = Findings::default();
    assert_eq!(World::of(&document, &mut findings).environments.len(), MOST + 1);
    let document = classic("EnvironmentLight { on FALSE } EnvironmentLight { }").clean();
    assert_eq!(World::of(&document, &mut findings).environments.len(), 1);
}
