//! JSON parser that reads a text once, in place, without copies.
//!
//! The caller states the expected value at each place: the fields of an object, the elements of an array, a number. Any other
//! value is [skipped](Cursor::skip) if it is valid JSON, and [`Malformed`] otherwise. Real-time: bounded by the length of the
//! text, no allocation.

/// Error: the text is not JSON, is nested too deeply, or contains another kind of value than expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Malformed;

/// Limit on the nesting depth: a state has five levels.
const DEEPEST: u32 = 32;

/// Read position in a text.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a> {
    text: &'a [u8],
    at: usize,
    depth: u32,
}

/// Scalar value: neither object nor array.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scalar<'a> {
    /// A number; infinite if it is too large for an `f64`.
    Number(f64),
    /// A string with its escapes undecoded.
    Text(&'a str),
    /// `true` or `false`.
    Flag(bool),
    /// `null`.
    Null,
}

impl std::fmt::Display for Scalar<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Number(number) => write!(formatter, "{number}"),
            Self::Text(text) => write!(formatter, "`{text}`"),
            Self::Flag(flag) => write!(formatter, "{flag}"),
            Self::Null => formatter.write_str("null"),
        }
    }
}

impl<'a> Cursor<'a> {
    /// Creates a cursor at the beginning of a text.
    #[must_use]
    pub fn new(text: &'a [u8]) -> Self {
        Self { text, at: 0, depth: 0 }
    }

    /// Returns the next byte after white space without consuming it.
    fn peek(&mut self) -> Result<u8, Malformed> {
        while let Some(byte) = self.text.get(self.at) {
            if !b" \t\r\n".contains(byte) {
                return Ok(*byte);
            }
            self.at += 1;
        }
        Err(Malformed)
    }

    fn expect(&mut self, byte: u8) -> Result<(), Malformed> {
        if self.peek()? != byte {
            return Err(Malformed);
        }
        self.at += 1;
        Ok(())
    }

    /// Reads the comma-separated items between two brackets, each with `item`.
    fn items(
        &mut self,
        [open, close]: [u8; 2],
        mut item: impl FnMut(&mut Self) -> Result<(), Malformed>,
    ) -> Result<(), Malformed> {
        self.expect(open)?;
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(Malformed);
        }
        if self.peek()? != close {
            loop {
                item(self)?;
                if self.peek()? != b',' {
                    break;
                }
                self.at += 1;
            }
        }
        self.depth -= 1;
        self.expect(close)
    }

    /// Reads an object: `field` is called with each name, and must read or skip the value.
    ///
    /// # Errors
    /// [`Malformed`], and errors of `field`.
    pub fn fields(
        &mut self,
        mut field: impl FnMut(&str, &mut Self) -> Result<(), Malformed>,
    ) -> Result<(), Malformed> {
        self.items(*b"{}", |cursor| {
            let name = cursor.text()?;
            cursor.expect(b':')?;
            field(name, cursor)
        })
    }

    /// Reads an array: `element` must read or skip a value each time.
    ///
    /// # Errors
    /// [`Malformed`], and errors of `element`.
    pub fn elements(
        &mut self,
        element: impl FnMut(&mut Self) -> Result<(), Malformed>,
    ) -> Result<(), Malformed> {
        self.items(*b"[]", element)
    }

    /// Reads a string; its escapes stay undecoded.
    ///
    /// # Errors
    /// If the value is not a string.
    pub fn text(&mut self) -> Result<&'a str, Malformed> {
        self.expect(b'"')?;
        let start = self.at;
        loop {
            match self.text.get(self.at) {
                Some(b'"') => break,
                Some(b'\\') => self.at += 2,
                Some(byte) if *byte >= b' ' => self.at += 1,
                _ => return Err(Malformed),
            }
        }
        let bytes = self.text.get(start..self.at).ok_or(Malformed)?;
        self.at += 1;
        std::str::from_utf8(bytes).map_err(|_| Malformed)
    }

    /// Reads a number.
    ///
    /// # Errors
    /// If the value is not a number.
    pub fn number(&mut self) -> Result<f64, Malformed> {
        let Scalar::Number(number) = self.scalar()? else { return Err(Malformed) };
        Ok(number)
    }

    /// Reads `true` or `false`.
    ///
    /// # Errors
    /// If the value is neither `true` nor `false`.
    pub fn flag(&mut self) -> Result<bool, Malformed> {
        let Scalar::Flag(flag) = self.scalar()? else { return Err(Malformed) };
        Ok(flag)
    }

    /// Reads a scalar value.
    ///
    /// # Errors
    /// If the value is an object, an array or no JSON.
    pub fn scalar(&mut self) -> Result<Scalar<'a>, Malformed> {
        if self.peek()? == b'"' {
            return self.text().map(Scalar::Text);
        }
        let rest = self.text.get(self.at..).ok_or(Malformed)?;
        let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || b"+-.".contains(byte);
        let length = rest.iter().take_while(|byte| is_part(byte)).count();
        let token = rest.get(..length).and_then(|token| std::str::from_utf8(token).ok());
        self.at += length;
        match token.ok_or(Malformed)? {
            "true" => Ok(Scalar::Flag(true)),
            "false" => Ok(Scalar::Flag(false)),
            "null" => Ok(Scalar::Null),
            // Rust's parser also accepts `NaN` and `inf`; a JSON number begins with a digit.
            number if number.trim_start_matches('-').starts_with(|first: char| first.is_ascii_digit()) => {
                number.parse().map(Scalar::Number).map_err(|_| Malformed)
            }
            _ => Err(Malformed),
        }
    }

    /// Skips a value of any kind.
    ///
    /// # Errors
    /// If the value is not valid JSON.
    pub fn skip(&mut self) -> Result<(), Malformed> {
        match self.peek()? {
            b'{' => self.fields(|_, cursor| cursor.skip()),
            b'[' => self.elements(Self::skip),
            _ => self.scalar().map(drop),
        }
    }

    /// Checks that only white space follows the value.
    ///
    /// # Errors
    /// If another byte follows.
    pub fn end(&mut self) -> Result<(), Malformed> {
        if self.peek().is_ok() { Err(Malformed) } else { Ok(()) }
    }

    /// Looks up the scalar at a path of field names without moving the cursor; `None` if there is none, or if the value is an
    /// object or an array.
    ///
    /// # Errors
    /// If the text is not valid JSON.
    pub fn at(mut self, path: &[&str]) -> Result<Option<Scalar<'a>>, Malformed> {
        let Some((first, rest)) = path.split_first() else {
            return match self.peek()? {
                b'{' | b'[' => Ok(None),
                _ => self.scalar().map(Some),
            };
        };
        if self.peek()? != b'{' {
            return Ok(None);
        }
        let mut found = None;
        self.fields(|name, cursor| {
            if name == *first {
                found = cursor.at(rest)?;
            }
            cursor.skip()
        })?;
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str =
        r#" {"a": [1, -2.5e3 ,{"b":"c\"d"}], "e": {"f": {"g": true}, "h": null}, "i": 1e999} "#;

    #[test]
    fn values_are_found_by_their_paths() {
        let cursor = Cursor::new(TEXT.as_bytes());
        for (path, value) in [
            (&["e", "f", "g"][..], Some(Scalar::Flag(true))),
            (&["e", "h"], Some(Scalar::Null)),
            (&["e", "f"], None),
            (&["a"], None),
            (&["nothing"], None),
            (&["i"], Some(Scalar::Number(f64::INFINITY))),
        ] {
            assert_eq!(cursor.at(path), Ok(value), "{path:?}");
        }
        let mut numbers = Vec::new();
        let mut walking = cursor;
        walking
            .fields(|name, cursor| match name {
                "a" => cursor.elements(|cursor| match cursor.at(&["b"])? {
                    Some(text) => {
                        assert_eq!(text, Scalar::Text("c\\\"d"));
                        cursor.skip()
                    }
                    None => cursor.number().map(|number| numbers.push(number)),
                }),
                _ => cursor.skip(),
            })
            .expect("it is JSON");
        assert_eq!((numbers, walking.end()), (vec![1.0, -2500.0], Ok(())));
    }

    #[test]
    fn what_is_no_json_is_said_to_be_none() {
        let deep = "[".repeat(100_000);
        for wrong in [
            "",
            "{",
            "{\"a\"}",
            "{\"a\":}",
            "[1,]",
            "NaN",
            "inf",
            "-",
            "{\"a\": NaN}",
            "\"",
            "\"\\",
            "[1 2]",
            &deep,
        ] {
            assert_eq!(
                Cursor::new(wrong.as_bytes()).skip(),
                Err(Malformed),
                "{}",
                &wrong[..wrong.len().min(9)]
            );
        }
    }

    proptest! {
        /// Any bytes end in an answer, and each beginning of a text that is JSON is none.
        #[test]
        fn every_text_is_read_to_an_end(bytes in prop::collection::vec(any::<u8>(), 0..200), length in 0..78_usize) {
            let _ = Cursor::new(&bytes).skip();
            prop_assert_eq!(Cursor::new(&TEXT.as_bytes()[..length]).skip(), Err(Malformed));
        }
    }
}
