//! A check of an OBJ file's text before `tobj` reads it.
//!
//! `tobj` gives no line numbers, overflows on huge indices, takes polylines for faces and stumbles over
//! comments behind numbers, vertex colours on some vertices only, continued lines and bytes that are not
//! UTF-8. One pass over the bytes, which costs a small part of the parsing, finds the faults with their
//! lines and blanks what is not needed in place. Line numbers stay as in the file.

use memchr::memchr;

use super::ObjFault;

/// Stands for a line feed that a backslash cancels; white space to `tobj`, a new line to [`line_of`].
const CONTINUED: u8 = 0x0b;

/// Digits of an index that cannot overflow 64 bits. One with more is refused, leading zeros or not.
const MOST_DIGITS: usize = 18;

/// A fault and its line, from 1.
pub(super) type FaultAt = (usize, ObjFault);

/// What was found, and what was blanked.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Scan {
    vertices: usize,
    texcoords: usize,
    normals: usize,
    /// Faces.
    pub(super) faces: usize,
    /// Polylines, which throw no shadow.
    pub(super) polylines: usize,
    /// Whether bytes that are not UTF-8 were replaced.
    pub(super) replaced_bytes: bool,
}

/// Checks `text` and makes it safe for `tobj`.
///
/// # Errors
/// The first line that is broken, apart from numbers that do not parse: see [`locate`].
pub(super) fn prepare(text: &mut [u8]) -> Result<Scan, FaultAt> {
    let mut scan = Scan::default();
    if let Some(at) = memchr(0, text) {
        return Err((line_of(text, at), ObjFault::NotText(0)));
    }
    if memchr(b'\n', text).is_none() {
        replace(text, b'\r', b'\n');
    }
    replace(text, CONTINUED, b' ');
    let continued = join_continued_lines(text);
    let ascii = text.is_ascii();
    let (mut rest, mut line) = (text, 1);
    while !rest.is_empty() {
        let end = memchr(b'\n', rest).unwrap_or(rest.len());
        let (statement, after) = rest.split_at_mut(end);
        if !ascii {
            scan.replaced_bytes |= replace_foreign_bytes(statement);
        }
        scan.check(statement).map_err(|fault| (line, fault))?;
        line += 1 + if continued { count(CONTINUED, statement) } else { 0 };
        rest = after.get_mut(1..).unwrap_or_default();
    }
    Ok(scan)
}

impl Scan {
    fn check(&mut self, statement: &mut [u8]) -> Result<(), ObjFault> {
        let indent = statement.iter().take_while(|b| is_space(**b)).count();
        let keyword_end =
            statement[indent..].iter().position(|&b| is_space(b)).map_or(statement.len(), |n| indent + n);
        match &statement[indent..keyword_end] {
            b"v" => {
                self.vertices += 1;
                check_position(&mut statement[keyword_end..])
            }
            b"vt" => {
                self.texcoords += 1;
                let found = count_words(&mut statement[keyword_end..]);
                let expected = "2 or 3 numbers";
                if found >= 2 { Ok(()) } else { Err(ObjFault::Count { keyword: "vt", expected, found }) }
            }
            b"vn" => {
                self.normals += 1;
                let found = count_words(&mut statement[keyword_end..]);
                let expected = "3 numbers";
                if found >= 3 { Ok(()) } else { Err(ObjFault::Count { keyword: "vn", expected, found }) }
            }
            b"f" => {
                self.faces += 1;
                self.check_face(&mut statement[keyword_end..])
            }
            b"l" => {
                self.polylines += 1;
                statement[indent] = b'#';
                Ok(())
            }
            keyword @ (b"o" | b"g" | b"usemtl" | b"mtllib") => {
                if keyword == b"usemtl" && statement[keyword_end..].iter().all(|&b| is_space(b)) {
                    return Err(ObjFault::Name("usemtl"));
                }
                // `tobj` takes the name from behind the first blank.
                if keyword_end < statement.len() {
                    statement[keyword_end] = b' ';
                }
                statement.rotate_left(indent);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn check_face(&self, corners: &mut [u8]) -> Result<(), ObjFault> {
        let mut count = 0;
        let mut at = 0;
        while at < corners.len() {
            if is_space(corners[at]) {
                at += 1;
                continue;
            }
            if corners[at] == b'#' {
                corners[at..].fill(b' ');
                break;
            }
            let corner = &corners[at..];
            at += corner.len() - self.check_corner(corner)?.len();
            count += 1;
        }
        if count < 3 { Err(ObjFault::Corners(count)) } else { Ok(()) }
    }

    /// Checks the corner that `text` begins with and returns what is behind it.
    fn check_corner<'t>(&self, text: &'t [u8]) -> Result<&'t [u8], ObjFault> {
        let broken = || Err(ObjFault::Corner(first_word(text)));
        let mut rest = text;
        for (part, count) in [self.vertices, self.texcoords, self.normals].into_iter().enumerate() {
            let start = rest;
            if let [b'-' | b'+', after @ ..] = rest {
                rest = after;
            }
            let digits = rest;
            let mut index = 0usize;
            while let [digit @ b'0'..=b'9', after @ ..] = rest {
                // Wraps only beyond the digits that are checked below.
                index = index.wrapping_mul(10).wrapping_add(usize::from(digit - b'0'));
                rest = after;
            }
            let length = digits.len() - rest.len();
            if length > 0 {
                if index == 0 || index > count || length > MOST_DIGITS {
                    return Err(self.out_of_range(part, &start[..start.len() - rest.len()]));
                }
            } else if part == 0 || rest.len() < start.len() {
                return broken();
            }
            match rest {
                [b'/', after @ ..] if part < 2 => rest = after,
                [] => return Ok(rest),
                [byte, ..] if is_space(*byte) => return Ok(rest),
                _ => return broken(),
            }
        }
        Ok(rest)
    }

    /// The fault of an index that is zero, out of range, or longer than any that is in range.
    fn out_of_range(&self, part: usize, index: &[u8]) -> ObjFault {
        let (what, count) =
            [("vertex", self.vertices), ("texture coordinate", self.texcoords), ("normal", self.normals)]
                [part];
        ObjFault::OutOfRange { what, index: first_word(index), count }
    }
}

/// Checks how many numbers a vertex has, and blanks its colour: shadows have none.
fn check_position(numbers: &mut [u8]) -> Result<(), ObjFault> {
    // The common case in one pass without branches: words, and bytes that need a closer look. "nan" and "inf"
    // parse as numbers, and no other number has an n.
    let (mut count, mut was_space, mut unusual) = (0, true, false);
    for &byte in &*numbers {
        let space = is_space(byte);
        count += usize::from(was_space & !space);
        was_space = space;
        unusual |= (byte == b'#') | (byte | 0x20 == b'n');
    }
    if count == 3 && !unusual {
        return Ok(());
    }
    if unusual {
        count = count_words(numbers);
        if let Some(word) = words(numbers).find(|word| word.iter().any(|b| b | 0x20 == b'n')) {
            let word = first_word(word);
            return Err(match word.parse::<f32>() {
                Ok(_) => ObjFault::NotFinite(word),
                Err(_) => ObjFault::Number(word),
            });
        }
    }
    match count {
        3 | 4 => Ok(()),
        6.. => {
            let (mut word, mut was_space) = (0, true);
            for byte in numbers {
                word += usize::from(was_space && !is_space(*byte));
                was_space = is_space(*byte);
                if word > 3 {
                    *byte = b' ';
                }
            }
            Ok(())
        }
        found => {
            let expected = "3 numbers (4 with a weight, 6 with a colour)";
            Err(ObjFault::Count { keyword: "v", expected, found })
        }
    }
}

/// Words between white space.
fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&b| is_space(b)).filter(|word| !word.is_empty())
}

/// Counts words before a comment, and blanks the comment.
fn count_words(text: &mut [u8]) -> usize {
    let (mut count, mut in_word) = (0, false);
    for at in 0..text.len() {
        match text[at] {
            b if is_space(b) => in_word = false,
            b'#' if !in_word => {
                text[at..].fill(b' ');
                break;
            }
            _ => {
                count += usize::from(!in_word);
                in_word = true;
            }
        }
    }
    count
}

/// Finds the number that `tobj` refused, or that is not finite, in a text that [`prepare`] has passed.
pub(super) fn locate(text: &[u8]) -> Option<FaultAt> {
    let mut line = 1;
    for statement in text.split(|&b| b == b'\n') {
        let mut statement_words = words(statement);
        let needed = match statement_words.next() {
            Some(b"v") => 4,
            Some(b"vt") => 2,
            Some(b"vn") => 3,
            _ => 0,
        };
        for (i, word) in statement_words.take(needed).enumerate() {
            let word = String::from_utf8_lossy(word).into_owned();
            match word.parse::<f32>() {
                Err(_) => return Some((line, ObjFault::Number(word))),
                Ok(0.0) if i == 3 => return Some((line, ObjFault::ZeroWeight)),
                Ok(number) if !number.is_finite() && needed == 4 => {
                    return Some((line, ObjFault::NotFinite(word)));
                }
                Ok(_) => {}
            }
        }
        line += 1 + count(CONTINUED, statement);
    }
    None
}

/// The line of a face, counted from 0, in a text that [`prepare`] has passed.
pub(super) fn line_of_face(text: &[u8], face: usize) -> usize {
    let mut line = 1;
    let mut faces = 0;
    for statement in text.split(|&b| b == b'\n') {
        let mut statement_words = words(statement);
        if statement_words.next() == Some(b"f") {
            if faces == face {
                break;
            }
            faces += 1;
        }
        line += 1 + count(CONTINUED, statement);
    }
    line
}

/// The line of a byte, from 1.
fn line_of(text: &[u8], at: usize) -> usize {
    1 + count(b'\n', &text[..at])
}

fn count(byte: u8, text: &[u8]) -> usize {
    memchr::memchr_iter(byte, text).count()
}

/// White space as `tobj` sees it, within ASCII.
fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t'..=b'\r')
}

fn first_word(text: &[u8]) -> String {
    let end = text.iter().position(|&b| is_space(b)).unwrap_or(text.len());
    // Enough to recognise it: a hostile word may be long.
    String::from_utf8_lossy(&text[..end.min(40)]).into_owned()
}

fn replace(text: &mut [u8], from: u8, to: u8) {
    if memchr(from, text).is_some() {
        text.iter_mut().filter(|b| **b == from).for_each(|b| *b = to);
    }
}

/// A backslash at the end of a line continues it on the next. Returns whether there is one.
fn join_continued_lines(text: &mut [u8]) -> bool {
    let mut joined = false;
    let mut from = 0;
    while let Some(at) = memchr(b'\\', &text[from..]).map(|n| from + n) {
        let feed = if text.get(at + 1) == Some(&b'\r') { at + 2 } else { at + 1 };
        if text.get(feed) == Some(&b'\n') {
            text[at..feed].fill(b' ');
            text[feed] = CONTINUED;
            joined = true;
        }
        from = at + 1;
    }
    joined
}

/// Keeps what is not ASCII in names, if it is UTF-8, and replaces it by '?' elsewhere; a number that held it
/// does not parse then. Returns whether something was replaced that is not UTF-8.
fn replace_foreign_bytes(statement: &mut [u8]) -> bool {
    let utf8 = std::str::from_utf8(statement).is_ok();
    let named = [&b"o "[..], b"g ", b"usemtl ", b"mtllib "]
        .iter()
        .any(|keyword| statement.trim_ascii_start().starts_with(keyword));
    if !(utf8 && named) {
        statement.iter_mut().filter(|b| !b.is_ascii()).for_each(|b| *b = b'?');
    }
    !utf8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(text: &str) -> Result<Scan, FaultAt> {
        prepare(&mut text.as_bytes().to_vec())
    }

    fn prepared(text: &[u8]) -> String {
        let mut bytes = text.to_vec();
        prepare(&mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

    #[test]
    fn corners_in_all_forms_are_counted() {
        let text = format!(
            "{TRIANGLE}vt 0 0\nvn 0 0 1\nf 1 2 3\nf 1/1 2/1 3/1\nf -3//-1 -2//1 3//1\nf 1/1/1 2/1/1 3/1/1\n"
        );
        assert_eq!(scan(&text).unwrap().faces, 4);
    }

    #[test]
    fn faults_have_lines() {
        let fault = |face: &str| scan(&format!("{TRIANGLE}\n{face}")).unwrap_err();
        let vertex = |index: &str| ObjFault::OutOfRange { what: "vertex", index: index.into(), count: 3 };
        assert_eq!(fault("f 1 2 4"), (5, vertex("4")));
        assert_eq!(fault("f 0 1 2"), (5, vertex("0")));
        assert_eq!(fault("f -4 1 2"), (5, vertex("-4")));
        assert_eq!(fault("f 99999999999999999999999 1 2"), (5, vertex("99999999999999999999999")));
        assert_eq!(fault("f 1 2"), (5, ObjFault::Corners(2)));
        assert_eq!(fault("f 1 2 x"), (5, ObjFault::Corner("x".into())));
        assert_eq!(
            fault("f 1 2 3/1/1/1").1.to_string(),
            "the face refers to texture coordinate 1, but there are none above it"
        );
        assert_eq!(
            fault("v 1 2"),
            (
                5,
                ObjFault::Count {
                    keyword: "v",
                    expected: "3 numbers (4 with a weight, 6 with a colour)",
                    found: 2
                }
            )
        );
        assert_eq!(fault("v 1 nan 2"), (5, ObjFault::NotFinite("nan".into())));
        assert_eq!(fault("usemtl"), (5, ObjFault::Name("usemtl")));
        assert_eq!(scan("# ok\nv\0").unwrap_err(), (2, ObjFault::NotText(0)));
    }

    #[test]
    fn what_tobj_cannot_read_is_blanked() {
        assert_eq!(prepared(b"v 1 2 3 0.5 0.5 0.5"), "v 1 2 3            ");
        assert_eq!(prepared(b"v 1 2 3 # here"), "v 1 2 3       ");
        assert_eq!(prepared(b"l 1 2 3"), "# 1 2 3");
        assert_eq!(prepared(b"  usemtl\tred"), "usemtl red  ");
        assert_eq!(prepared("o Bäume".as_bytes()), "o Bäume");
        assert_eq!(prepared(b"# B\xe4ume"), "# B?ume");
        assert_eq!(prepared(b"v 0 0 0\rv 1 1 1"), "v 0 0 0\nv 1 1 1");
    }

    #[test]
    fn continued_lines_keep_later_line_numbers() {
        let text = format!("{TRIANGLE}f 1 \\\n2 \\\r\n3\nf 9 9 9");
        assert_eq!(scan(&text).unwrap_err().0, 7);
        let mut bytes = format!("{TRIANGLE}f 1 \\\n2 3\nf 3 2 1\nv x 0 0").into_bytes();
        prepare(&mut bytes).unwrap();
        assert_eq!(line_of_face(&bytes, 1), 6);
        assert_eq!(locate(&bytes), Some((7, ObjFault::Number("x".into()))));
    }

    #[test]
    fn numbers_are_located() {
        assert_eq!(locate(b"v 0 0 0\nv 0 1,5 0"), Some((2, ObjFault::Number("1,5".into()))));
        assert_eq!(locate(b"v 0 0 1e99"), Some((1, ObjFault::NotFinite("1e99".into()))));
        assert_eq!(locate(b"v 0 0 1 0"), Some((1, ObjFault::ZeroWeight)));
        assert_eq!(locate(b"vt 0 q"), Some((1, ObjFault::Number("q".into()))));
    }
}
