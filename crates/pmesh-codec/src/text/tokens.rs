//! Cuts bytes into braces and numbers, keeping count of lines. Knows nothing of blocks.

use crate::{DecodeError, Place};

/// Longest number, in characters.
const TOKEN_LIMIT: usize = 64;
/// Longest part of a first comment that is kept.
const COMMENT_LIMIT: usize = 64;

#[derive(Debug, PartialEq)]
pub(super) enum Token {
    Open,
    Close,
    Number(f64),
    /// As `Number`, written with a stray full stop behind it.
    StrayStop(f64),
    /// The comment that begins the file, without its line end.
    FirstComment(String),
}

#[derive(Default)]
pub(super) struct Tokens {
    pub(super) line: u64,
    number: String,
    comment: Option<String>,
    anything_seen: bool,
    in_comment: bool,
}

impl Tokens {
    pub(super) fn new() -> Self {
        Self { line: 1, ..Default::default() }
    }
    pub(super) fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// Takes one byte; gives at most a number and then a brace.
    pub(super) fn push(
        &mut self,
        byte: u8,
        mut give: impl FnMut(Token, u64) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        if self.in_comment {
            self.push_comment(byte, &mut give)?;
        } else if byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e' | b'E') {
            self.number.push(byte as char);
            if self.number.len() > TOKEN_LIMIT {
                let got = self.number.len() as u64;
                return Err(DecodeError::Limit {
                    place: self.place(),
                    what: "a number's length",
                    got,
                    limit: TOKEN_LIMIT as u64,
                });
            }
        } else {
            self.end_number(&mut give)?;
            match byte {
                b'{' => give(Token::Open, self.line)?,
                b'}' => give(Token::Close, self.line)?,
                b'#' => {
                    self.in_comment = true;
                    self.comment = (!self.anything_seen).then(String::new);
                }
                b',' | b' ' | b'\t' | b'\r' | b'\n' => {}
                _ => {
                    let message = format!("{:?} is neither a number, a comma, a brace nor a comment", byte as char);
                    return Err(DecodeError::syntax(self.place(), message));
                }
            }
        }
        self.anything_seen |= !byte.is_ascii_whitespace();
        self.line += u64::from(byte == b'\n');
        Ok(())
    }

    fn push_comment(
        &mut self,
        byte: u8,
        give: &mut impl FnMut(Token, u64) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        if byte == b'\n' {
            self.in_comment = false;
            if let Some(text) = self.comment.take() {
                give(Token::FirstComment(text), self.line)?;
            }
        } else if let Some(text) = &mut self.comment
            && text.len() < COMMENT_LIMIT
        {
            text.push(byte as char);
        }
        Ok(())
    }

    /// Ends the number that is being read, if there is one.
    pub(super) fn end_number(&mut self, give: &mut impl FnMut(Token, u64) -> Result<(), DecodeError>) -> Result<(), DecodeError> {
        if self.number.is_empty() {
            return Ok(());
        }
        let text = std::mem::take(&mut self.number);
        let stray = text.strip_suffix('.').filter(|head| head.contains('.'));
        let value: f64 =
            stray.unwrap_or(&text).parse().map_err(|_| DecodeError::syntax(self.place(), format!("{text:?} is not a number")))?;
        if !value.is_finite() {
            return Err(DecodeError::syntax(self.place(), format!("{text:?} is not finite")));
        }
        give(if stray.is_some() { Token::StrayStop(value) } else { Token::Number(value) }, self.line)
    }
}
