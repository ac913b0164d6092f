//! The operands of `map_*` statements: options, then the name of a file, which may hold blanks.

/// Options with the number of operands that each takes at least and at most.
const OPTIONS: [(&str, usize, usize); 14] = [
    ("-blendu", 1, 1),
    ("-blendv", 1, 1),
    ("-bm", 1, 1),
    ("-boost", 1, 1),
    ("-cc", 1, 1),
    ("-clamp", 1, 1),
    ("-colorspace", 1, 1),
    ("-imfchan", 1, 1),
    ("-mm", 2, 2),
    ("-o", 1, 3),
    ("-s", 1, 3),
    ("-t", 1, 3),
    ("-texres", 1, 1),
    ("-type", 1, 1),
];

/// A texture as a material names it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Map {
    /// The file; empty where the statement names none.
    pub(super) file: String,
    /// `-o`: added to the texture coordinates, after they were scaled.
    pub(super) offset: [f32; 2],
    /// `-s`: multiplies the texture coordinates, as modelling programs read it.
    pub(super) scale: [f32; 2],
    /// `-clamp on`: the texture is not repeated.
    pub(super) clamp: bool,
    /// `-bm`: multiplies the depth of a bump map.
    pub(super) bump: Option<f32>,
    /// `-imfchan`: the channel that a number is taken from.
    pub(super) channel: Option<Channel>,
    /// `-mm`: what is added to the values of the texture, and what they are multiplied with.
    pub(super) range: Option<[f32; 2]>,
    /// `-colorspace`, as written: whether it says what is so depends on what the picture holds.
    pub(super) space: Option<String>,
    /// Options that would change the picture and are not honoured, as written.
    pub(super) ignored: Vec<String>,
}

/// Where a texture of single numbers keeps them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Channel {
    Red,
    Green,
    Blue,
    /// The alpha channel (`m`, "matte").
    Matte,
    Luminance,
}

impl Map {
    fn of(file: String) -> Self {
        Self { file, offset: [0.0; 2], scale: [1.0; 2], clamp: false, bump: None, channel: None, range: None, space: None, ignored: vec![] }
    }

    /// Takes an option; false where it is none that this program honours.
    fn option(&mut self, name: &str, values: &[&str]) -> bool {
        let number = |i: usize| values.get(i).and_then(|v| v.parse::<f32>().ok()).filter(|v| v.is_finite());
        match name {
            "-o" => self.offset = [number(0).unwrap_or(0.0), number(1).unwrap_or(0.0)],
            "-s" => self.scale = [number(0).unwrap_or(1.0), number(1).unwrap_or(1.0)],
            "-clamp" => self.clamp = values == ["on"],
            "-bm" => self.bump = number(0),
            "-mm" => self.range = number(0).zip(number(1)).map(|(base, gain)| [base, gain]).filter(|range| *range != [0.0, 1.0]),
            "-imfchan" => {
                self.channel = match values {
                    ["r"] => Some(Channel::Red),
                    ["g"] => Some(Channel::Green),
                    ["b"] => Some(Channel::Blue),
                    ["m"] => Some(Channel::Matte),
                    ["l"] => Some(Channel::Luminance),
                    _ => return false,
                }
            }
            // These concern how an image is filtered.
            "-blendu" | "-blendv" | "-boost" | "-texres" => {}
            "-cc" => return values == ["off"],
            "-colorspace" => self.space = values.first().map(|v| (*v).to_owned()),
            "-t" => return values.iter().all(|v| v.parse() == Ok(0.0)),
            _ => return false,
        }
        true
    }
}

/// Reads what follows `map_Kd`. Options may stand before and after the name, as exporters write them.
pub(super) fn parse(operands: &str) -> Map {
    let words: Vec<&str> = operands.split_whitespace().collect();
    let (mut file, mut map) = (vec![], Map::of(String::new()));
    let mut at = 0;
    while at < words.len() {
        let option = OPTIONS.iter().find(|(name, ..)| *name == words[at]);
        let Some((name, least, most)) = option else {
            file.push(words[at]);
            at += 1;
            continue;
        };
        let given = operand_count(&words[at + 1..], *least, *most);
        if !map.option(name, &words[at + 1..at + 1 + given]) {
            map.ignored.push(words[at..=at + given].join(" "));
        }
        at += 1 + given;
    }
    map.file = file_name(operands, &file);
    map
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
            let map = parse(text);
            assert_eq!(
                (map.file.as_str(), map.ignored.as_slice()),
                (file, ignored.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>().as_slice()),
                "{text}"
            );
            map
        };
        check("my wall  red.png", "my wall  red.png", &[]);
        check("\"my wall.png\"", "my wall.png", &[]);
        assert_eq!(check("-o 0.1 diffuse.jpg", "diffuse.jpg", &[]).offset, [0.1, 0.0]);
        assert_eq!(check("-s 1 1 1 -o 0 0 0 diffuse.jpg", "diffuse.jpg", &[]), Map::of("diffuse.jpg".into()));
        assert_eq!(check("-s 0.1 0.2 7", "7", &[]).scale, [0.1, 0.2]);
        let map = check("-imfchan r bump map.jpg -bm 1.5", "bump map.jpg", &[]);
        assert_eq!((map.channel, map.bump), (Some(Channel::Red), Some(1.5)));
        assert!(check("-clamp on a.jpg", "a.jpg", &[]).clamp);
        assert_eq!(check("-blendu on -mm 0 1 a.jpg", "a.jpg", &[]).range, None);
        assert_eq!(check("-mm 0.5 2 a.jpg", "a.jpg", &[]).range, Some([0.5, 2.0]));
        check("-t 0 0 0 -cc off -type cube_top a.jpg", "a.jpg", &["-type cube_top"]);
        check("-t 1 -cc on -imfchan z a.jpg", "a.jpg", &["-t 1", "-cc on", "-imfchan z"]);
        check("-mm", "", &[]);
        check("", "", &[]);
    }
}
