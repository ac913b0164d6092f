//! What is peculiar to XML.

use crate::import::x3d::testing::{dump, outcome_of, xml};
use std::sync::Arc;

fn strings(attribute: &str) -> Vec<Arc<str>> {
    let document = xml(&format!("<NavigationInfo type={attribute}/>")).clean();
    document.roots().next().unwrap().mf_string("type").to_vec()
}

#[test]
fn quotes_in_lists_of_strings() {
    for text in [
        r#"'"a" "b \"c\""'"#,
        r#"'&quot;a&quot; &quot;b \&quot;c\&quot;&quot;'"#,
        r#""&quot;a&quot;, &quot;b \&quot;c\&quot;&quot;""#,
        r#"'"a"  &quot;b \"c\&quot;"'"#,
    ] {
        assert_eq!(strings(text), [Arc::from("a"), Arc::from("b \"c\"")], "{text}");
    }
    assert_eq!(strings("''"), [] as [Arc<str>; 0]);
    let document = xml("<NavigationInfo type='EXAMINE'/>")
        .warned("a:2: column 23: the field `type` of `NavigationInfo` has a list of strings without");
    assert_eq!(&*document.roots().next().unwrap().mf_string("type")[0], "EXAMINE");
    xml("<NavigationInfo type='\"a'/>")
        .failed("a:2: column 23: the field `type` of `NavigationInfo` has a string without its closing quote");
}

#[test]
fn source_code_is_text_or_cdata() {
    let text = "<Appearance><ComposedShader language='GLSL'><ShaderPart type='FRAGMENT'><![CDATA[void main() { a < b; }]]></ShaderPart>
        <ShaderPart containerField='parts'>x &lt; y</ShaderPart></ComposedShader></Appearance>";
    let document = xml(text).clean();
    let shader = document.roots().next().unwrap().node("shaders").unwrap();
    let codes: Vec<&str> = shader.children("parts").map(|p| p.string("sourceCode")).collect();
    assert_eq!(codes, ["void main() { a < b; }", "x < y"]);
    xml("<Box>text</Box>").warned("a:2: column 6: the field `sourceCode` of `Box` is unknown");
}

#[test]
fn pages_of_html_around_a_scene_are_passed_by() {
    let page = "<html xmlns='http://www.w3.org/1999/xhtml'><body><x3d version='3.3' width='9px'><scene><Shape class='c' id='i'><Box/></Shape></scene></x3d></body></html>";
    let document = outcome_of(&[("a", page.as_bytes())], None).clean();
    assert!(dump(&document).contains("Box"));
}

/// A browser hands a page out with all names in small letters.
#[test]
fn pages_of_html_write_names_without_capitals() {
    let page = |head: &str| {
        format!(
            "{head}<scene><transform def='T' translation='1 2 3'><shape><indexedfaceset def='F' coordindex='0 1 2' creaseangle='2'></indexedfaceset></shape></transform>
<shape><indexedfaceset use='F' containerfield='geometry'></indexedfaceset></shape><timesensor def='C'></timesensor><positioninterpolator def='I'></positioninterpolator>
<route fromnode='C' fromfield='fraction_changed' tonode='I' tofield='set_fraction'></route><odd></odd></scene></x3d>"
        )
    };
    let outcome = outcome_of(&[("a", page("<x3d>").as_bytes())], None);
    assert_eq!(
        outcome.warnings,
        [
            "a:1: column 13: nodes written in other capitals than X3D's, as pages of HTML have them, were read as X3D's: 6, the first here",
            "a:3: column 92: the node `odd` is unknown and was skipped: 1, here",
        ]
    );
    let document = outcome.document.unwrap();
    let roots: Vec<_> = document.roots().collect();
    assert_eq!((roots[0].def(), roots[0].vec3("translation"), document.routes.len()), (Some("T"), [1.0, 2.0, 3.0], 1));
    let face = roots[0].node("children").unwrap().node("geometry").unwrap();
    assert_eq!((face.mf_int("coordIndex"), face.float("creaseAngle")), (&[0, 1, 2][..], 2.0));
    assert_eq!(roots[1].node("geometry").unwrap().id(), face.id());
}

#[test]
fn document_types_are_allowed_and_not_fetched() {
    let text = "<?xml version='1.0'?><!DOCTYPE X3D PUBLIC 'ISO//Web3D//DTD X3D 3.0//EN' 'file:///etc/passwd' [<!ENTITY one '1 1 1'>]>
<X3D><Scene><Box size='&one;'/></Scene></X3D>";
    let document = outcome_of(&[("a", text.as_bytes())], None).clean();
    assert_eq!(document.roots().next().unwrap().vec3("size"), [1.0; 3]);
    let fails = |text: &str, error: &str| outcome_of(&[("a", text.as_bytes())], None).failed(error);
    fails(
        "<!DOCTYPE X3D [<!ENTITY x SYSTEM 'file:///etc/passwd'>]>\n<X3D><Scene><WorldInfo title='&x;'/></Scene></X3D>",
        "a:2: column 31: this is not well-formed XML",
    );
    fails("<!DOCTYPE X3D [<!ENTITY a 'x'>\n<!ENTITY b '&a;&a;'>]><X3D/>", "a:2: column 1: the entity `b` is made of others");
}

#[test]
fn what_is_not_x3d_is_an_error_with_line_and_column() {
    let fails = |text: &str, error: &str| outcome_of(&[("a", text.as_bytes())], None).failed(error);
    fails("<X3D>\n<Scene></X3D>", "a:2: column 8: this is not well-formed XML: expected 'Scene' tag, not 'X3D'");
    fails("<X3D>\n<Scene>", "a:2: column 8: this is not well-formed XML");
    fails("<?xml version='1.0'?>\n<COLLADA/>", "a:2: column 1: this is COLLADA, which is not supported");
    fails("<svg/>", "a:1: column 1: this is XML with the root `svg` and not X3D");
    fails("<X3D><Box/></X3D>", "a:1: column 6: `Box` where `head` or `Scene` should be");
    xml("<ROUTE fromNode='a'/>").failed("a:2: column 1: `ROUTE` has no attribute `fromField`");
    xml("<ProtoInstance/>").failed("a:2: column 1: `ProtoInstance` has no attribute `name`");
    xml("<ProtoDeclare name='P'><ProtoInterface>\n<field name='x' type='SFOdd' accessType='inputOnly'/></ProtoInterface></ProtoDeclare>")
        .failed("a:3: column 1: `SFOdd` is no type of fields");
    xml("<ProtoDeclare name='P'><ProtoInterface>\n<field name='x' type='SFBool' accessType='in'/></ProtoInterface></ProtoDeclare>")
        .failed("a:3: column 1: `in` is no access type");
    xml("<ExternProtoDeclare name='P'/>").failed("a:2: column 1: `ExternProtoDeclare` has no attribute `url`");
}
