use super::*;

fn read(ty: &str, text: &str, form: Form) -> Result<Parsed, Fault> {
    parse(FieldType::parse(ty).unwrap(), text, form)
}

fn clean(ty: &str, text: &str, form: Form) -> Value {
    let (value, remark) = read(ty, text, form).unwrap_or_else(|f| panic!("{ty} {text}: {f:?}"));
    assert_eq!(remark, None, "{ty} {text}");
    value
}

fn remark(ty: &str, text: &str, form: Form) -> (Value, String) {
    let (value, remark) = read(ty, text, form).unwrap();
    (value, remark.unwrap().message)
}

fn strings(list: &[&str]) -> Value {
    Value::Strings(list.iter().map(|s| Arc::from(*s)).collect())
}

/// Every type but the nodes', as Classic, XML and JSON write it, and what it is.
#[test]
fn every_type_in_every_encoding() {
    let floats = |v: &[f32]| Value::Floats(v.into());
    let doubles = |v: &[f64]| Value::Doubles(v.into());
    let ints = |v: &[i32]| Value::Ints(v.into());
    let upto = |n: u16| (0..n).map(|i| i.to_string()).collect::<Vec<_>>();
    let f = |n: u16| floats(&(0..n).map(f32::from).collect::<Vec<_>>());
    let d = |n: u16| doubles(&(0..n).map(f64::from).collect::<Vec<_>>());
    let numeric: [(&str, u16, bool); 16] = [
        ("Color", 3, false),
        ("ColorRGBA", 4, false),
        ("Double", 1, true),
        ("Float", 1, false),
        ("Matrix3d", 9, true),
        ("Matrix3f", 9, false),
        ("Matrix4d", 16, true),
        ("Matrix4f", 16, false),
        ("Rotation", 4, false),
        ("Time", 1, true),
        ("Vec2d", 2, true),
        ("Vec2f", 2, false),
        ("Vec3d", 3, true),
        ("Vec3f", 3, false),
        ("Vec4d", 4, true),
        ("Vec4f", 4, false),
    ];
    for (name, width, double) in numeric {
        for (prefix, count) in [("SF", width), ("MF", 2 * width), ("MF", 0)] {
            let ty = format!("{prefix}{name}");
            let expected = if double { d(count) } else { f(count) };
            let bare = upto(count).join(" ");
            assert_eq!(clean(&ty, &bare, Form::Classic), expected);
            assert_eq!(clean(&ty, &format!(" {} ", upto(count).join(", ")), Form::Xml), expected);
            let json = if count == 1 { bare } else { format!("[{}]", upto(count).join(",")) };
            assert_eq!(clean(&ty, &json, Form::Json), expected);
        }
    }
    for (form, yes, no) in [(Form::Classic, "TRUE", "FALSE"), (Form::Xml, "true", "false"), (Form::Json, "true", "false")] {
        assert_eq!(clean("SFBool", yes, form), ints(&[1]));
        assert_eq!(clean("MFBool", &format!("{yes},{no}"), form), ints(&[1, 0]));
        assert_eq!(clean("SFInt32", "-7", form), ints(&[-7]));
        assert_eq!(clean("MFInt32", "0 1,2 -1", form), ints(&[0, 1, 2, -1]));
        assert_eq!(clean("SFImage", "1 2 4 0xFF0000FF 4278190335", form), ints(&[1, 2, 4, -16_776_961, -16_776_961]));
        assert_eq!(clean("MFImage", "1 1 1 7 0 0 0 1 1 1 8", form), ints(&[1, 1, 1, 7, 0, 0, 0, 1, 1, 1, 8]));
    }
    assert_eq!(clean("SFString", r#""a \"b\" \\ \c""#, Form::Classic), strings(&[r#"a "b" \ \c"#]));
    assert_eq!(clean("SFString", r#"a "b""#, Form::Xml), strings(&[r#"a "b""#]));
    assert_eq!(clean("SFString", r#""a \"b\" \u00e4""#, Form::Json), strings(&["a \"b\" \u{e4}"]));
    assert_eq!(clean("MFString", "\"a # b\" \"c\"# d\n, \"\"", Form::Classic), strings(&["a # b", "c", ""]));
    assert_eq!(clean("MFString", r#" "a" ,"b \"c\"" "#, Form::Xml), strings(&["a", r#"b "c""#]));
    assert_eq!(clean("MFString", r#"["a", "b"]"#, Form::Json), strings(&["a", "b"]));
}

#[test]
fn numbers_are_read_in_the_width_they_are_kept_in() {
    assert_eq!(clean("SFFloat", ".1", Form::Classic), Value::Floats([0.1].into()));
    assert_eq!(clean("MFFloat", "+1. -2e-3 # 9\n 3E2", Form::Classic), Value::Floats([1.0, -0.002, 300.0].into()));
    assert_eq!(clean("SFDouble", "0.1", Form::Xml), Value::Doubles([0.1].into()));
    assert_eq!(clean("SFInt32", "0xffffffff", Form::Classic), Value::Ints([-1].into()));
}

#[test]
fn what_is_no_value_is_a_fault_with_its_place() {
    let cases = [
        ("SFFloat", "nan", 0, "`nan`, which is no number"),
        ("SFFloat", "1e39", 0, "not finite in 32 bits"),
        ("SFTime", "1e999", 0, "not finite"),
        ("MFFloat", "1 2 x", 4, "`x`, which is no number (value 3 of 3)"),
        ("SFVec3f", "1 2", 0, "2 of the 3 values that SFVec3f has"),
        ("SFBool", "yes", 0, "neither true nor false"),
        ("SFInt32", "1.5", 0, "no whole number"),
        ("SFInt32", "4294967295", 0, "no whole number"),
        ("SFImage", "2 2 3 1 2", 0, "2 of the 4 pixels"),
        ("SFImage", "-1 1 3", 0, "an image of -1 x 1"),
        ("SFImage", "2147483647 2147483647 4", 0, "0 of the 4611686014132420609 pixels"),
        ("SFImage", "1", 0, "without its size"),
        ("MFString", "\"a\" b", 4, "`b` where a string in quotes should be"),
        ("MFString", "\"a\" \"b", 4, "closing quote"),
        ("SFNode", "3", 0, "where a node should be"),
        ("SFString", "", 0, "no string"),
    ];
    for (ty, text, at, message) in cases {
        let fault = read(ty, text, Form::Classic).unwrap_err();
        assert!(fault.at == at && fault.message.contains(message), "{ty} {text}: {fault:?}");
    }
    assert!(read("MFString", "[1]", Form::Json).is_err() && read("SFFloat", "[", Form::Classic).is_err());
}

#[test]
fn what_is_too_much_is_dropped_and_said() {
    let (value, said) = remark("SFVec3f", "1 2 3 4", Form::Classic);
    assert_eq!(value, Value::Floats([1.0, 2.0, 3.0].into()));
    assert_eq!(said, "4 values where SFVec3f has 3; the others were dropped");
    let (value, said) = remark("MFVec2f", "1 2 3", Form::Xml);
    assert_eq!(value, Value::Floats([1.0, 2.0].into()));
    assert!(said.contains("no multiple of 2; the last 1 were dropped"), "{said}");
    assert_eq!(remark("SFImage", "1 1 1 5 6", Form::Classic).0, Value::Ints([1, 1, 1, 5].into()));
    assert_eq!(remark("MFString", "EXAMINE", Form::Xml).0, strings(&["EXAMINE"]));
    assert_eq!(remark("SFString", "\"a\" \"b\"", Form::Classic).0, strings(&["a"]));
}

#[test]
fn json_takes_what_older_converters_write() {
    assert_eq!(clean("SFVec3f", "\"0 1 2\"", Form::Json), Value::Floats([0.0, 1.0, 2.0].into()));
    assert_eq!(clean("MFVec3f", "[[0,1,2],[3,4,5]]", Form::Json), Value::Floats([0.0, 1.0, 2.0, 3.0, 4.0, 5.0].into()));
    assert_eq!(clean("MFString", r#""\"a\" \"b\"""#, Form::Json), strings(&["a", "b"]));
    assert_eq!(clean("MFString", r#""a""#, Form::Json), strings(&["a"]));
    assert_eq!(clean("SFBool", "\"true\"", Form::Json), Value::Ints([1].into()));
    assert_eq!(clean("SFImage", r#"[1,2,3,"0xFF00FF",255]"#, Form::Json), Value::Ints([1, 2, 3, 0xff_00ff, 255].into()));
}
