//! The operands of `map_*` statements: options, then the name of a file, which may hold blanks.

/// Options with the number of operands that each takes at least and at most.
const OPTIONS: [(&str, usize, usize); 13] = [
    ("-blendu", 1, 1),
    ("-blendv", 1, 1),
    ("-bm", 1, 1),
    ("-boost", 1, 1),
    ("-cc", 1, 1),
    ("-clamp", 1, 1),
    ("-imfchan", 1, 1),
    ("-mm", 2, 2),
    ("-o", 1, 3),
    ("-s", 1, 3),
    ("-t", 1, 3),
    ("-texres", 1, 1),
    ("-type", 1, 1),
];

/// A texture as a material names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Map {
    /// The file; empty where the statement names none.
    pub(super) file: String,
    /// Options that would change the picture and are not honoured, as written.
    pub(super) ignored: Vec<String>,
}

/// Reads what follows `map_Kd`. Options may stand before and after the name, as exporters write them.
pub(super) fn parse(operands: &str) -> Map {
    let words: Vec<&str> = operands.split_whitespace().collect();
    let (mut file, mut ignored) = (vec![], vec![]);
    let mut at = 0;
    while at < words.len() {
        let option = OPTIONS.iter().find(|(name, ..)| *name == words[at]);
        let Some((name, least, most)) = option else {
            file.push(words[at]);
            at += 1;
            continue;
        };
        let given = operand_count(&words[at + 1..], *least, *most);
        let values = &words[at + 1..at + 1 + given];
        if !changes_nothing(name, values) {
            ignored.push(words[at..=at + given].join(" "));
        }
        at += 1 + given;
    }
    Map { file: file_name(operands, &file), ignored }
}

/// How many of the words belong to an option: the least it needs, and then as many numbers as it may have while a word remains that can
/// be the file.
fn operand_count(words: &[&str], least: usize, most: usize) -> usize {
    let mut count = least.min(words.len());
    while count < most && count + 1 < words.len() && words[count].parse::<f32>().is_ok() {
        count += 1;
    }
    count
}

/// Options at their defaults, and those that concern only how an image is filtered.
fn changes_nothing(name: &str, values: &[&str]) -> bool {
    let all = |default: f32| values.iter().all(|v| v.parse::<f32>().is_ok_and(|x| x == default));
    match name {
        "-blendu" | "-blendv" | "-boost" | "-texres" => true,
        "-clamp" | "-cc" => values == ["off"],
        "-bm" | "-s" => all(1.0),
        "-o" | "-t" => all(0.0),
        "-mm" => values.iter().map(|v| v.parse::<f32>()).eq([Ok(0.0), Ok(1.0)]),
        _ => false,
    }
}

/// The name with the blanks between its words as they stand in the text, without quotes around it.
fn file_name(operands: &str, words: &[&str]) -> String {
    let (Some(first), Some(last)) = (words.first(), words.last()) else { return String::new() };
    let joined = words.join(" ");
    let exact = operands.find(first).zip(operands.rfind(last)).map(|(start, end)| operands.get(start..end + last.len()).unwrap_or(""));
    let name = exact.filter(|e| e.split_whitespace().eq(words.iter().copied())).unwrap_or(&joined);
    name.strip_prefix('"').and_then(|n| n.strip_suffix('"')).unwrap_or(name).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_told_from_names() {
        let check = |text: &str, file: &str, ignored: &[&str]| {
            assert_eq!(parse(text), Map { file: file.into(), ignored: ignored.iter().map(|s| (*s).into()).collect() }, "{text}");
        };
        check("diffuse.jpg", "diffuse.jpg", &[]);
        check("my wall  red.png", "my wall  red.png", &[]);
        check("\"my wall.png\"", "my wall.png", &[]);
        check("-o 0.1 diffuse.jpg", "diffuse.jpg", &["-o 0.1"]);
        check("-s 1 1 1 -o 0 0 0 diffuse.jpg", "diffuse.jpg", &[]);
        check("-s 0.1 0.2 7", "7", &["-s 0.1 0.2"]);
        check("-imfchan r bump map.jpg -bm 1.5", "bump map.jpg", &["-imfchan r", "-bm 1.5"]);
        check("-clamp on a.jpg", "a.jpg", &["-clamp on"]);
        check("-blendu on -mm 0 1 a.jpg", "a.jpg", &[]);
        check("-type cube_top", "", &["-type cube_top"]);
        check("-mm", "", &["-mm"]);
        check("", "", &[]);
    }
}
