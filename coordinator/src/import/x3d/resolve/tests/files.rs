//! Prototypes and scenes of other files, their units and names.

use super::{kinds, roots};
use crate::import::{
    Bundle, Content, Part,
    findings::Findings,
    x3d::{
        Inlined, NodeRef, read,
        testing::{classic, outcome_of},
    },
};

#[test]
fn external_prototypes_come_from_the_bundle() {
    let library = "#X3D V3.0 utf8\nGroup { }\nPROTO First [ ] { Box { } }\nPROTO Second [ field SFFloat r 1 ] { Sphere { radius IS r } }";
    let xml_library = "<X3D><Scene><ProtoDeclare name='Third'><ProtoBody><Cone/></ProtoBody></ProtoDeclare></Scene></X3D>";
    let main = "#X3D V3.0 utf8
EXTERNPROTO A [ ] \"lib/l.x3dv\"
EXTERNPROTO Mine [ field SFFloat r ] [ \"http://example.com/none.x3dv#Second\" \"lib/l.x3dv#Second\" ]
EXTERNPROTO Third [ ] \"t.x3d#Third\"
A { } Mine { r 7 } Third { }";
    let files = [("main.x3dv", main.as_bytes()), ("lib/l.x3dv", library.as_bytes()), ("t.x3d", xml_library.as_bytes())];
    let document = outcome_of(&files, None).clean();
    assert_eq!(kinds(document.roots()), ["Box", "Sphere", "Cone"]);
    assert_eq!(roots(&document)[1].float("radius"), 7.0);
    assert_eq!(document.file(roots(&document)[1].place()).as_str(), "lib/l.x3dv");
}

/// An address counts from the file that it is written in, which is not that of the node if an instance of a prototype says it.
#[test]
fn values_know_their_file() {
    let library = "#X3D V3.0 utf8\nPROTO P [ field MFString u \"own.png\" ] { ImageTexture { url IS u } }";
    let main = "#X3D V3.0 utf8\nEXTERNPROTO P [ ] \"lib/l\"\nP { u \"mine.png\" }\nP { }";
    let document = outcome_of(&[("main", main.as_bytes()), ("lib/l", library.as_bytes())], None).clean();
    let files: Vec<&str> = document.roots().map(|t| t.file_of("url").as_str()).collect();
    assert_eq!(files, ["main", "lib/l"]);
    assert_eq!(document.roots().map(|t| t.file_of("repeatS").as_str()).collect::<Vec<_>>(), ["lib/l"; 2]);
}

#[test]
fn missing_and_circular_external_prototypes_are_said() {
    let outcome =
        classic("EXTERNPROTO E [ ] [ \"gone.x3dv#E\" \"urn:x\" ]\nE { } Group { children [ E { } DEF X E { } ] } Shape { geometry USE X }");
    let expected = [
        "a:2: column 19: the external prototype `E` is at none of its addresses in the bundle: `gone.x3dv#E`, `urn:x`",
        "a:3: column 1: the external prototype `E` was not found and its instances were skipped: 3, the first here",
    ];
    assert_eq!(outcome.warnings, expected);
    let circle = |other: &str| format!("#X3D V3.0 utf8\nEXTERNPROTO E [ ] \"{other}#E\"\nE {{ }}");
    let (a, b) = (circle("b"), circle("a"));
    let outcome = outcome_of(&[("a", a.as_bytes()), ("b", b.as_bytes())], None);
    assert!(outcome.errors.is_empty() && outcome.warnings.iter().any(|w| w.contains("was not found")), "{:?}", outcome.warnings);
    // An extension that is declared for viewers which lack it is ours.
    let document = classic("EXTERNPROTO MatrixTransform [ ] \"urn:some:where\" MatrixTransform { }").clean();
    assert_eq!(kinds(document.roots()), ["MatrixTransform"]);
}

#[test]
fn inlined_files_in_any_encoding() {
    let files: [(&str, &[u8]); 5] = [
        ("main.wrl", b"#VRML V2.0 utf8\nInline { url [ \"none.wrl\" \"a.x3d\" ] } Inline { url \"b.json\" } Inline { url \"sub/c%20d.glb\" }\nInline { url \"sub/e.x3dv#View\" }"),
        ("a.x3d", b"<X3D><Scene><Box/><Cone/></Scene></X3D>"),
        ("b.json", b"{\"X3D\": {\"Scene\": {\"-children\": [{\"Sphere\": {}}]}}}"),
        ("sub/c d.glb", b"glTF\x02\0\0\0"),
        ("sub/e.x3dv", b"#X3D V3.0 utf8\nInline { url \"../a.x3d\" }"),
    ];
    let document = outcome_of(&files, None).clean();
    let inlined: Vec<Vec<&str>> = document
        .roots()
        .map(|n| match n.inlined().unwrap() {
            Inlined::Nodes(ids) => kinds(ids.iter().map(|id| document.node(*id))),
            Inlined::File(path) => vec![if path.as_str() == "sub/c d.glb" { "file" } else { "wrong file" }],
        })
        .collect();
    assert_eq!(inlined, [vec!["Box", "Cone"], vec!["Sphere"], vec!["file"], vec!["Inline"]]);
    // The same file twice is read once.
    assert_eq!(document.nodes().filter(|n| n.kind() == "Cone").count(), 1);
    assert_eq!(document.files().len(), 4);
}

/// A file is looked at once to tell what it is, however many nodes inline it: one that cannot be read is said once.
#[test]
fn a_file_is_looked_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let gone = folder.path().join("gone");
    std::fs::write(&gone, b"glTF").unwrap();
    let part = |name: &str, content| Part { name: name.into(), content };
    let main = b"#X3D V3.0 utf8\nInline { url \"b.glb\" } DEF I Inline { url \"b.glb\" } Inline { url \"b.glb\" }";
    let parts = vec![part("a", Content::Bytes(main.to_vec())), part("b.glb", Content::File(gone.clone()))];
    let bundle = Bundle::from_parts(parts, Some("a"), folder.path()).unwrap();
    std::fs::remove_file(&gone).unwrap();
    let mut findings = Findings::default();
    assert!(read(&bundle, bundle.main(), main, None, &mut findings).is_some());
    let errors = findings.into_errors("a");
    assert_eq!((errors.len(), errors[0].file.as_deref()), (1, Some("b.glb")), "{errors:?}");
}

#[test]
fn inlines_that_lead_nowhere_or_back_are_said() {
    classic("Inline { url [ \"x.wrl\" ] }").warned("a:2: column 14: the Inline of `x.wrl` was skipped: no such file");
    classic("Inline { } Inline { load FALSE url \"a\" }")
        .warned("a:2: column 1: Inline nodes without an address, or told not to load, were skipped: 2");
    classic("Box { }\nGroup { children Inline { url \"a\" } }").warned("a:3: column 31: `a` is inlined inside itself");
    let main = b"#X3D V3.0 utf8\nInline { url \"b\" }";
    outcome_of(&[("a", main), ("b", b"#X3D V3.0 utf8\nInline { url \"a\" }")], None).warned("b:2: column 14: `a` is inlined inside itself");
    outcome_of(&[("a", main), ("b", b"#X3D V3.0 utf8\nBox { ")], None).failed("b:2: column 7: expected `}` of `Box` in line 2");
}

#[test]
fn units_are_of_a_file() {
    let main = "#X3D V3.3 utf8\nUNIT length inch 0.5\nUNIT angle turn 2\nTransform { rotation 0 0 1 3 } SpotLight { cutOffAngle 0.25 } Inline { url \"b\" }";
    let document = outcome_of(&[("a", main.as_bytes()), ("b", b"#X3D V3.3 utf8\nTransform { rotation 0 0 1 3 }")], None).clean();
    let root = roots(&document)[0];
    assert_eq!((root.kind(), root.vec3("scale")), ("Transform", [0.5; 3]));
    let children: Vec<_> = root.children("children").collect();
    assert_eq!((children[0].vec4("rotation")[3], children[1].float("cutOffAngle")), (6.0, 0.5));
    // Inside the Inline a metre is a metre again, and an angle a radian.
    let Some(Inlined::Nodes(ids)) = children[2].inlined() else { panic!() };
    let scaled = document.node(ids[0]);
    assert_eq!((scaled.vec3("scale"), scaled.node("children").unwrap().vec4("rotation")[3]), ([2.0; 3], 3.0));
}

#[test]
fn units_that_are_none_are_said() {
    classic("UNIT unknown x 2").warned("a:2: column 1: `unknown` is no category of units");
    for factor in ["0", "-1", "x", "1e300", "1e-300"] {
        classic(&format!("UNIT length x {factor}")).warned("a:2: column 1: the unit of `length` has the factor");
    }
    classic("UNIT mass x 2 UNIT force y 3 Box { }").clean();
}

#[test]
fn angles_of_prototypes_are_angles_where_they_end() {
    let text = "UNIT angle half 0.5\nPROTO P [ field SFFloat a 1 field SFRotation r 0 0 1 1 ] { Transform { rotation IS r children SpotLight { cutOffAngle IS a beamWidth IS a } } } P { a 2 }";
    let document = classic(text).clean();
    let transform = roots(&document)[0];
    let light = transform.node("children").unwrap();
    assert_eq!((light.float("cutOffAngle"), light.float("beamWidth"), transform.vec4("rotation")[3]), (1.0, 1.0, 0.5));
}

/// A library in half metres, used from a file in quarter metres: each number is in the unit of the file that it stands in.
#[test]
fn units_are_kept_across_external_prototypes() {
    let library = "#X3D V3.3 utf8\nUNIT length half 0.5\nUNIT angle turn 2
PROTO Cell [ field MFNode inside [ ] field SFFloat cut 0.25 ] { Transform { translation 1 0 0 children [ Group { children IS inside } SpotLight { cutOffAngle IS cut } ] } }
PROTO Form [ ] { Box { size 1 1 1 } }
PROTO Sun [ ] { DirectionalLight { } }";
    let main = "#X3D V3.3 utf8\nUNIT length quarter 0.25\nEXTERNPROTO Cell [ field MFNode inside field SFFloat cut ] \"l#Cell\"
EXTERNPROTO Sun [ ] \"l#Sun\" EXTERNPROTO Form [ ] \"l#Form\"
Cell { inside Transform { translation 3 0 0 } cut 0.5 } Cell { } Sun { } Shape { geometry Form { } }";
    let document = outcome_of(&[("a", main.as_bytes()), ("l", library.as_bytes())], None).warned(
        "a:5: column 91: geometry without a shape crosses from a file to one with another unit of length, which was not converted: 1, here",
    );
    let world = roots(&document)[0];
    assert_eq!((world.kind(), world.vec3("scale")), ("Transform", [0.25; 3]));
    let [cell, plain, sun, _] = world.children("children").collect::<Vec<_>>()[..] else { panic!() };
    assert_eq!((cell.vec3("scale"), sun.kind()), ([2.0; 3], "DirectionalLight"), "as half metres in quarter metres; a sun has no size");
    let parts = |cell: NodeRef<'_>| cell.node("children").unwrap().children("children").map(|n| n.id()).collect::<Vec<_>>();
    let [group, light] = parts(cell)[..] else { panic!() };
    let handed = document.node(group).node("children").unwrap();
    assert_eq!((handed.vec3("scale"), handed.node("children").unwrap().vec3("translation")), ([0.5; 3], [3.0, 0.0, 0.0]));
    assert_eq!(document.node(light).float("cutOffAngle"), 0.5, "written in radians");
    assert_eq!(document.node(parts(plain)[1]).float("cutOffAngle"), 0.5, "written in the library's unit: 2 x 0.25");
}

/// A default of a library stands in the library's units, also where the field is IS one that has no value; a humanoid is scaled like a
/// group.
#[test]
fn defaults_and_humanoids_of_a_library_keep_its_units() {
    let library = "#X3D V3.3 utf8\nUNIT length mm 0.001
PROTO L [ inputOutput MFNode kids [ Shape { } ] ] { Group { children IS kids } }
PROTO Body [ ] { HAnimHumanoid { } }
PROTO Sun [ ] { EnvironmentLight { } }";
    let main =
        "#X3D V3.3 utf8\nEXTERNPROTO L [ inputOutput MFNode kids ] \"l#L\" EXTERNPROTO Body [ ] \"l#Body\" EXTERNPROTO Sun [ ] \"l#Sun\"
PROTO Q [ inputOnly MFNode add ] { L { kids IS add } }
Q { } Body { } Sun { }";
    let document = outcome_of(&[("a", main.as_bytes()), ("l", library.as_bytes())], None).clean();
    let [first, body, sun] = roots(&document)[..] else { panic!() };
    assert_eq!((first.vec3("scale"), body.vec3("scale"), sun.kind()), ([0.001; 3], [0.001; 3], "EnvironmentLight"));
    assert_eq!(body.node("children").unwrap().kind(), "HAnimHumanoid");
    assert_eq!(first.node("children").unwrap().node("children").unwrap().kind(), "Shape");
}

#[test]
fn names_of_an_inlined_file_are_imported_where_it_exports_them() {
    let inner = b"#X3D V3.0 utf8\nDEF Hidden Group { } DEF Open Transform { }\nEXPORT Open AS Door\nEXPORT Nobody";
    let main = "#X3D V3.0 utf8\nDEF In Inline { url \"b\" }\nIMPORT In.Door AS D\nIMPORT In.Hidden\nGroup { children USE D }\nROUTE Hidden.x TO D.translation";
    let outcome = outcome_of(&[("a", main.as_bytes()), ("b", inner)], None);
    assert_eq!(
        outcome.warnings,
        ["b:4: column 1: EXPORT: no node `Nobody`; it was skipped", "a:4: column 1: IMPORT: `In` exports no `Hidden`; it was skipped"]
    );
    let document = outcome.document.unwrap();
    assert_eq!(roots(&document)[1].node("children").unwrap().kind(), "Transform");
}
