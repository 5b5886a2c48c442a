//! Words and numbers of text formats, with the line for the message.

use crate::BuildError;

/// A line of a text file.
pub(super) struct Line<'a> {
    pub(super) format: &'static str,
    pub(super) number: usize,
    pub(super) words: std::str::SplitAsciiWhitespace<'a>,
}

/// The lines of `bytes` without comments and empty lines; bytes that are not UTF-8 are replaced, since names may hold any.
pub(super) fn lines<'a>(format: &'static str, text: &'a str) -> impl Iterator<Item = Line<'a>> {
    text.lines().enumerate().filter_map(move |(i, line)| {
        let line = line.split('#').next().unwrap_or("");
        let words = line.split_ascii_whitespace();
        (!line.trim().is_empty()).then_some(Line { format, number: i + 1, words })
    })
}

impl Line<'_> {
    pub(super) fn error(&self, message: impl Into<String>) -> BuildError {
        BuildError::Line { format: self.format, line: self.number, message: message.into() }
    }
    pub(super) fn float(&mut self) -> Result<f32, BuildError> {
        let word = self.words.next().ok_or_else(|| self.error("a number is missing"))?;
        self.parse_float(word)
    }
    pub(super) fn parse_float(&self, word: &str) -> Result<f32, BuildError> {
        match word.parse::<f32>() {
            Ok(x) if x.is_finite() => Ok(x),
            Ok(_) => Err(self.error(format!("{word:?} is not finite"))),
            Err(_) => Err(self.error(format!("{word:?} is not a number"))),
        }
    }
    pub(super) fn floats<const N: usize>(&mut self) -> Result<[f32; N], BuildError> {
        let mut out = [0.0; N];
        for x in &mut out {
            *x = self.float()?;
        }
        Ok(out)
    }
    /// All the numbers that are left.
    pub(super) fn rest(&mut self) -> Result<Vec<f32>, BuildError> {
        let words: Vec<_> = self.words.by_ref().collect();
        words.iter().map(|w| self.parse_float(w)).collect()
    }
    pub(super) fn count(&mut self) -> Result<usize, BuildError> {
        let word = self.words.next().ok_or_else(|| self.error("a count is missing"))?;
        word.parse().map_err(|_| self.error(format!("{word:?} is not a count")))
    }
    pub(super) fn index(&mut self, count: usize) -> Result<u32, BuildError> {
        let word = self.words.next().ok_or_else(|| self.error("an index is missing"))?;
        match word.parse::<u32>() {
            Ok(i) if (i as usize) < count => Ok(i),
            _ => Err(self.error(format!("{word:?} is not the index of a vertex (0 to {})", count.saturating_sub(1)))),
        }
    }
}
