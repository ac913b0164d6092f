//! Files of megabytes: a grid of squares in each format that lists vertices, as programs write them, and lists as dense as can be.

use base64::{Engine as _, engine::general_purpose::STANDARD};

/// Squares a side.
const SIDE: usize = 180;

/// Targets and what they read.
pub(crate) fn inputs() -> Vec<(&'static str, Vec<u8>)> {
    let text = [
        ("obj", obj()),
        ("obj", dense_faces()),
        ("obj", polypaint()),
        ("x3d_xml", x3d_xml()),
        ("x3d_classic", x3d_classic()),
        ("x3d_json", x3d_json()),
        ("gltf", gltf()),
        ("gltf", zeros()),
    ];
    text.map(|(name, text)| (name, text.into_bytes())).into_iter().chain([("glb", glb())]).collect()
}

/// One triangle again and again: nothing in OBJ takes more for each of its bytes, names aside.
fn dense_faces() -> String {
    format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{}", "f 1 2 3\n".repeat(500_000))
}

/// A colour more than a list that doubles has room for, and as many vertices.
fn polypaint() -> String {
    let (lines, vertices) = ((1 << 19) / 64, (1 << 19) + 1);
    let paint = format!("#MRGB {}\n", "ff102030".repeat(64));
    format!("{}{}#MRGB ff000000\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\n".repeat(vertices / 3 + 1), paint.repeat(lines))
}

fn zeros() -> String {
    format!(r#"{{"asset":{{"version":"2.0"}},"extras":[0{}]}}"#, ",0".repeat(1 << 21))
}

fn points() -> impl Iterator<Item = [usize; 2]> {
    (0..=SIDE).flat_map(|y| (0..=SIDE).map(move |x| [x, y]))
}

fn squares() -> impl Iterator<Item = [usize; 4]> {
    (0..SIDE * SIDE).map(|i| (i / SIDE) * (SIDE + 1) + i % SIDE).map(|a| [a, a + 1, a + SIDE + 2, a + SIDE + 1])
}

fn obj() -> String {
    let at = points().map(|[x, y]| format!("v {x}.250000 {y}.500000 0.125000\nvt 0.{x:06} 0.{y:06}\n"));
    let faces = squares().map(|c| format!("f {}\n", c.map(|i| format!("{0}/{0}", i + 1)).join(" ")));
    at.chain(faces).collect()
}

/// Points and the corners of faces, each number with `behind` after it but for the last.
fn lists(behind: &str) -> [String; 2] {
    let at: Vec<_> = points().map(|[x, y]| format!("{x}.250000{behind}{y}.500000{behind}0.125000")).collect();
    let faces: Vec<_> = squares().map(|c| format!("{1}{0}{2}{0}{3}{0}{4}{0}-1", behind, c[0], c[1], c[2], c[3])).collect();
    [at.join(behind), faces.join(behind)]
}

fn x3d_xml() -> String {
    let [at, faces] = lists(" ");
    format!("<X3D><Scene><Shape><IndexedFaceSet coordIndex='{faces}'><Coordinate point='{at}'/></IndexedFaceSet></Shape></Scene></X3D>")
}

fn x3d_classic() -> String {
    let [at, faces] = lists(" ");
    format!("#X3D V3.3 utf8\nShape {{ geometry IndexedFaceSet {{ coordIndex [ {faces} ] coord Coordinate {{ point [ {at} ] }} }} }}")
}

fn x3d_json() -> String {
    let [at, faces] = lists(",");
    let set = format!(r#"{{"@coordIndex":[{faces}],"-coord":{{"Coordinate":{{"@point":[{at}]}}}}}}"#);
    format!(r#"{{"X3D":{{"@version":"3.3","Scene":{{"-children":[{{"Shape":{{"-geometry":{{"IndexedFaceSet":{set}}}}}}}]}}}}}}"#)
}

/// Points and triangles as a buffer has them, and the bytes of the first.
fn buffer() -> (Vec<u8>, usize) {
    let mut bytes: Vec<u8> = points().flat_map(|[x, y]| [x as f32, y as f32, 0.0]).flat_map(f32::to_le_bytes).collect();
    let at = bytes.len();
    bytes.extend(squares().flat_map(|[a, b, c, d]| [a, b, c, a, c, d]).flat_map(|i| (i as u32).to_le_bytes()));
    (bytes, at)
}

fn document(address: &str) -> String {
    let (bytes, at) = buffer();
    let (all, points, side) = (bytes.len(), at / 12, SIDE);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"buffers":[{{{address}"byteLength":{all}}}],"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "bufferViews":[{{"buffer":0,"byteLength":{at}}},{{"buffer":0,"byteOffset":{at},"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":{points},"type":"VEC3","min":[0,0,0],"max":[{side},{side},0]}},
            {{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}]}}"#,
        all - at,
        (all - at) / 4
    )
}

fn gltf() -> String {
    document(&format!(r#""uri":"data:application/octet-stream;base64,{}","#, STANDARD.encode(buffer().0)))
}

fn glb() -> Vec<u8> {
    let (mut json, bytes) = (document("").into_bytes(), buffer().0);
    json.resize(json.len().next_multiple_of(4), b' ');
    let words = |words: [u32; 2]| words.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>();
    let length = (28 + json.len() + bytes.len()) as u32;
    [b"glTF".to_vec(), words([2, length]), words([json.len() as u32, 0x4e4f_534a]), json, words([bytes.len() as u32, 0x004e_4942]), bytes]
        .concat()
}
