//! What materials look like.

use super::*;

fn png(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut out = Cursor::new(vec![]);
    let image = RgbaImage::from_fn(width, height, |x, y| Rgba(pixel(x, y)));
    DynamicImage::from(image).write_to(&mut out, ImageFormat::Png).unwrap();
    out.into_inner()
}

/// The scene of a square of one material that shines, so that nothing is said of light, beside some pictures.
fn look(mtl: &str) -> (Scene, Vec<String>) {
    let parts = vec![
        file("a.obj", format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1/1 2/2 3/3 4/4\n")),
        file("m.mtl", format!("newmtl m\nKe 1 1 1\n{mtl}")),
        file("grey.png", png(2, 1, |x, _| if x == 0 { [51, 51, 51, 255] } else { [255; 4] })),
        file("leaf.png", png(2, 1, |x, _| [9, 99, 9, if x == 0 { 0 } else { 255 }])),
        file("mist.png", png(2, 1, |x, _| [200, 200, 200, if x == 0 { 128 } else { 99 }])),
        file("packed.png", png(2, 2, |_, _| [0, 100, 200, 255])),
        file("normals.png", png(2, 2, |_, _| [128, 128, 255, 255])),
    ];
    let imported = import_parts(parts).unwrap();
    (imported.scene, imported.warnings.iter().map(ToString::to_string).collect())
}

fn material(mtl: &str) -> (Material, Vec<String>) {
    let (scene, said) = look(mtl);
    (scene.materials[0].clone(), said)
}

fn physical(m: &Material) -> &MetallicRoughness {
    let Reflection::MetallicRoughness(physical) = &m.reflection else { panic!("{m:?}") };
    physical
}

fn phong(m: &Material) -> &Phong {
    let Reflection::Phong(phong) = &m.reflection else { panic!("{m:?}") };
    phong
}

#[test]
fn opacity_is_d_or_what_tr_leaves() {
    let opacity = |mtl: &str| material(mtl).0.opacity;
    let blend = |factor| Opacity { mode: AlphaMode::Blend, factor, texture: None };
    assert_eq!((opacity("d 0.25"), opacity("d -halo 0.25")), (blend(0.25), blend(0.25)));
    assert_eq!((opacity("Tr 0.25"), opacity("Tr 0.5\nd 0.75")), (blend(0.75), blend(0.75)));
    assert_eq!((opacity("d 1\nTr 0"), opacity("illum 2")), (Opacity::OPAQUE, Opacity::OPAQUE));
}

#[test]
fn pictures_cut_out_or_blend() {
    let (leaf, said) = look("map_Kd leaf.png");
    let opacity = leaf.materials[0].opacity;
    assert_eq!((opacity.mode, opacity.texture.unwrap().texture), (AlphaMode::Mask { cutoff: 0.5 }, 0));
    assert!(leaf.textures[0].has_alpha && said[0].starts_with("m.mtl:3: the texture `leaf.png` has transparent pixels"), "{said:?}");
    assert_eq!(material("map_Kd mist.png").0.opacity.mode, AlphaMode::Blend);
    // A picture of its own: its luminance, whatever map_Kd holds.
    let (grey, said) = look("map_Kd leaf.png\nmap_d -s 2 2 grey.png");
    let own = grey.materials[0].opacity.texture.unwrap();
    let texture = &grey.textures[own.texture as usize];
    assert_eq!(texture.texels.iter().skip(3).step_by(4).copied().collect::<Vec<_>>(), [51, 255]);
    assert_eq!((own.transform[0][0], said), (2.0, vec![]));
    // Its alpha channel, where it has one, or any channel that is asked for.
    let alphas = |mtl: &str| {
        let (scene, _) = look(mtl);
        let texture = scene.textures.last().unwrap();
        texture.texels.iter().skip(3).step_by(4).copied().collect::<Vec<_>>()
    };
    assert_eq!((alphas("map_d mist.png"), alphas("map_d -imfchan r mist.png")), (vec![128, 99], vec![200, 200]));
    assert_eq!(alphas("map_d -mm 0.2 0.5 grey.png"), [77, 179]);
    assert_eq!(material("map_d packed.png\nd 0.5").0.opacity.factor, 0.5);
}

#[test]
fn glass_is_what_its_model_says_and_lets_light_through() {
    let (m, said) = material("Kd 0.2 0.2 0.2\nTf 1 0 0\nd 0.25\nNi 1.3\nillum 7");
    let glass = physical(&m);
    assert_eq!((glass.transmission, glass.ior, glass.roughness, m.opacity), (0.75, 1.3, 0.0, Opacity::OPAQUE));
    assert!((glass.base_color.r - 0.8).abs() < 1e-6 && (glass.base_color.g - 0.05).abs() < 1e-6, "{:?}", glass.base_color);
    assert!(said.len() == 1 && said[0].starts_with("m.mtl:7: the material `m` is glass"), "{said:?}");
    assert_eq!(physical(&material("Tf 0.5\nNi 1.5\nillum 6").0).transmission, 1.0);
    assert_eq!(physical(&material("d 0.5\nillum 4\nNs 30").0).roughness, 0.5);
    // What Maya writes of plaster.
    assert_eq!(material("Kd 0.5\nTf 1 1 1\nNi 1\nillum 4").0.opacity, Opacity::OPAQUE);
    phong(&material("Kd 0.5\nTf 1 1 1\nNi 1\nillum 4").0);
    phong(&material("d 0.5\nillum 2").0);
}

#[test]
fn the_pbr_extension_makes_metallic_roughness() {
    let (m, said) = material("Kd 0.5 0.4 0.3\nPr 0.25\nPm 1\nNi 1.45");
    let metal = physical(&m);
    assert_eq!((metal.base_color, metal.roughness, metal.metallic, metal.ior), (Rgb::new(0.5, 0.4, 0.3), 0.25, 1.0, 1.45));
    assert_eq!(said, [""; 0]);
    let (coated, said) = material("Kd 0.5\nPr 0.8\nPc 1\nPcr 0.1");
    assert!(physical(&coated).roughness < 0.8 && said[0].starts_with("m.mtl:5: clear coats (Pc)"), "{said:?}");
    assert_eq!(physical(&material("Pm 0.5\nNs 30").0).roughness, 0.5, "as wide as the highlight");
    let glass = |more: &str| physical(&material(&format!("d 0.5\nillum 4\n{more}")).0).clone();
    let (bare, coated) = (glass(""), glass("Pc 1\nPcr 0.5"));
    assert_eq!((bare.ior, bare.roughness, coated.transmission), (1.5, 0.0, 0.5));
    assert!(coated.ior > 1.5 && coated.roughness > 0.0, "the coat lies on the glass: {coated:?}");
}

#[test]
fn roughness_and_metalness_share_a_texture() {
    let texels = |mtl: &str| {
        let (scene, said) = look(mtl);
        assert_eq!(said, [""; 0]);
        let m = physical(&scene.materials[0]);
        let texture = &scene.textures[m.metallic_roughness_texture.unwrap().texture as usize];
        (m.roughness, m.metallic, texture.texels.clone())
    };
    assert_eq!(texels("map_Pr grey.png"), (1.0, 0.0, vec![255, 51, 255, 255, 255, 255]));
    assert_eq!(texels("map_Pm grey.png\nPr 0.5"), (0.5, 1.0, vec![255, 255, 51, 255, 255, 255]));
    assert_eq!(texels("map_Pr packed.png\nmap_Pm packed.png").2, [255, 100, 200].repeat(4), "green and blue of one picture");
    // Another size: the smaller is stretched.
    let (.., both) = texels("map_Pr grey.png\nmap_Pm -imfchan g packed.png");
    assert_eq!(both, [255, 51, 100, 255, 255, 100].repeat(2));
}

#[test]
fn options_lay_and_repeat_pictures() {
    let (m, said) = material("map_Kd -s 2 3 1 -o 0.25 0.5 -clamp on grey.png\nmap_Ks -t 1 1 1 grey.png\nKs 0.1");
    let base = phong(&m).layers[0].texture;
    assert_eq!((base.transform, base.wrap), ([[2.0, 0.0, 0.25], [0.0, 3.0, 0.5]], [Wrap::Clamp; 2]));
    assert!(phong(&m).specular_texture.is_some());
    assert!(said[0].starts_with("m.mtl:4: the option `-t 1 1 1` of map_Ks"), "{said:?}");
    let (m, said) = material("Ks 0.1\nNs 100\nmap_Ns grey.png");
    assert_eq!(phong(&m).lobe, kiln_proto::scene::Lobe::Phong { exponent: 100.0 * 0.6 });
    assert!(said[0].starts_with("m.mtl:5: map_Ns is approximated by its mean"), "{said:?}");
}

#[test]
fn normal_maps_are_told_from_heights() {
    let (m, said) = material("norm -bm 2 normals.png");
    assert_eq!((m.normal_map.unwrap().scale, said), (2.0, vec![]));
    let (m, said) = material("map_Bump -bm 0.5 normals.png");
    assert!(m.normal_map.unwrap().scale == 0.5 && said[0].starts_with("m.mtl:3: the bump map `normals.png` holds normals"), "{said:?}");
    let (m, said) = material("bump grey.png");
    assert!(m.normal_map.is_none() && said[0].starts_with("m.mtl:3: the bump map `grey.png` holds heights"), "{said:?}");
}

#[test]
fn what_shines_brighter_than_the_brightest_is_refused_at_its_line() {
    let shining = |ke: &str| {
        let mtl = format!("newmtl m\nKd 0.5\nKe {ke}\n");
        import_parts(vec![file("a.obj", format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3\n")), file("m.mtl", mtl)])
    };
    assert_eq!(shining("1e13").unwrap().scene.materials[0].emission.r, 1e13);
    assert_eq!(shining("0 2e13 0").unwrap_err(), ["m.mtl:3: Ke is 2e13; at most 1e13 is possible"]);
}

#[test]
fn faces_without_coordinates_are_counted_where_a_texture_needs_them() {
    let obj = format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3\nf 1/1 3/3 4/4\n");
    let parts = vec![file("a.obj", obj), file("m.mtl", "newmtl m\nKe 1\nmap_Kd t.png\n"), file("t.png", png(1, 1, |_, _| [255; 4]))];
    let said: Vec<String> = import_parts(parts).unwrap().warnings.iter().map(ToString::to_string).collect();
    assert!(said.len() == 1 && said[0].starts_with("a.obj:11: faces lack the texture coordinates"), "{said:?}");
}
