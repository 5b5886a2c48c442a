//! X3D's XML encoding to the same tree as VRML: an element is a node, an attribute a field, a child a field of its parent.
//!
//! The little of XML that X3D uses is read here: an XML crate would add a twentieth to the browser module.

use super::tree::{COPY_LIMIT, Node, Parsed, Value, parse};
use std::collections::HashMap;

/// Deepest nesting.
const DEPTH_LIMIT: usize = 64;

/// The field of its parent that an element stands in if it does not say (`containerField`).
fn container(name: &str) -> &'static str {
    match name {
        "Coordinate" | "CoordinateDouble" => "coord",
        "Color" | "ColorRGBA" => "color",
        "Normal" => "normal",
        "TextureCoordinate" => "texCoord",
        "Appearance" => "appearance",
        "Material" => "material",
        "ImageTexture" | "PixelTexture" => "texture",
        "ProgLOD" => "levels",
        n if n.contains("Set") || n.contains("Prog") || n == "Box" || n == "Sphere" => "geometry",
        _ => "children",
    }
}

/// What comes next in a document.
enum Markup<'a> {
    /// Name, attributes, and whether it ends at once.
    Start(&'a str, Vec<(&'a str, String)>, bool),
    End(&'a str),
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Reader<'a> {
    fn line(&self) -> u64 {
        self.text.as_bytes()[..self.at.min(self.text.len())].iter().filter(|&&b| b == b'\n').count() as u64 + 1
    }
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }
    /// Passes over all up to and with `end`.
    fn past(&mut self, end: &str, what: &str) -> Result<&'a str, String> {
        let rest = self.rest();
        let found = rest.find(end).ok_or_else(|| format!("the file ends inside {what}"))?;
        self.at += found + end.len();
        Ok(&rest[..found])
    }
    fn white(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }
    fn name(&mut self) -> &'a str {
        let rest = self.rest();
        let end = rest.find(|c: char| c.is_whitespace() || "=/>".contains(c)).unwrap_or(rest.len());
        self.at += end;
        &rest[..end]
    }

    /// The next tag; text, comments, declarations and instructions are passed over. `None` at the end.
    fn next(&mut self) -> Result<Option<Markup<'a>>, String> {
        loop {
            let Some(open) = self.rest().find('<') else { return Ok(None) };
            self.at += open;
            let rest = self.rest();
            if rest.starts_with("<!--") {
                self.past("-->", "a comment")?;
            } else if rest.starts_with("<![CDATA[") {
                self.past("]]>", "a CDATA section")?;
            } else if rest.starts_with("<?") {
                self.past("?>", "an instruction")?;
            } else if rest.starts_with("<!") {
                // A DOCTYPE may hold declarations of its own in brackets.
                let head = self.past(">", "a declaration")?;
                if head.contains('[') && !head.contains(']') {
                    self.past("]", "a declaration")?;
                    self.past(">", "a declaration")?;
                }
            } else if rest.starts_with("</") {
                self.at += 2;
                return Ok(Some(Markup::End(self.past(">", "a tag")?.trim())));
            } else {
                self.at += 1;
                return self.start().map(Some);
            }
        }
    }
    fn start(&mut self) -> Result<Markup<'a>, String> {
        let tag = self.name();
        let mut attributes = Vec::new();
        loop {
            self.white();
            let rest = self.rest();
            if rest.starts_with("/>") {
                self.at += 2;
                return Ok(Markup::Start(tag, attributes, true));
            }
            if rest.starts_with('>') {
                self.at += 1;
                return Ok(Markup::Start(tag, attributes, false));
            }
            let name = self.name();
            if name.is_empty() {
                return Err(if rest.is_empty() {
                    format!("the file ends inside <{tag}>")
                } else {
                    format!("<{tag}> is malformed")
                });
            }
            self.past("=", "an attribute")
                .and_then(|gap| if gap.trim().is_empty() { Ok(()) } else { Err(format!("{name} has no value")) })?;
            self.white();
            let quote = match self.rest().chars().next() {
                Some(q @ ('"' | '\'')) => q,
                _ => return Err(format!("the value of {name} is not quoted")),
            };
            self.at += 1;
            attributes.push((name, plain(self.past(quote.encode_utf8(&mut [0; 4]), "an attribute")?)?));
        }
    }
}

/// Text with its entities replaced: the five of XML, and characters by number.
fn plain(text: &str) -> Result<String, String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find('&') {
        out.push_str(&rest[..at]);
        let (name, after) = rest[at + 1..].split_once(';').ok_or("an & that begins no entity: write &amp;")?;
        let number = name.strip_prefix("#x").map(|h| u32::from_str_radix(h, 16)).or(name.strip_prefix('#').map(str::parse));
        out.push(match (name, number) {
            ("lt", _) => '<',
            ("gt", _) => '>',
            ("quot", _) => '"',
            ("apos", _) => '\'',
            ("amp", _) => '&',
            (_, Some(Ok(code))) => char::from_u32(code).ok_or_else(|| format!("&{name}; is no character"))?,
            _ => return Err(format!("the entity &{name}; is not known")),
        });
        rest = after;
    }
    out.push_str(rest);
    Ok(out)
}

/// An element that is not closed yet.
struct Open<'a> {
    tag: &'a str,
    def: Option<String>,
    /// Field of its parent.
    field: Option<String>,
    node: Node,
}

impl Open<'_> {
    fn add(&mut self, field: String, node: Node) {
        match self.node.fields.iter_mut().find(|f| f.0 == field) {
            Some((_, values)) => values.push(Value::Node(node)),
            None => self.node.fields.push((field, vec![Value::Node(node)])),
        }
    }
}

/// Parses an X3D document. O(length), and what USE copies. Of one that is cut short, what was open counts as it is.
pub fn parse_xml(text: &str) -> Parsed {
    let mut out = Parsed::default();
    let mut reader = Reader { text, at: 0 };
    let mut open: Vec<Open> = Vec::new();
    let result = read(&mut reader, &mut open, &mut out);
    // From the inside out.
    while let Some(last) = open.pop() {
        close(last, &mut open, &mut out.nodes);
    }
    out.error = result.err().map(|what| (reader.line(), what));
    out
}

fn close(element: Open, open: &mut [Open], nodes: &mut Vec<Node>) {
    let field = element.field.unwrap_or_else(|| container(&element.node.name).into());
    match open.last_mut() {
        Some(parent) => parent.add(field, element.node),
        None => nodes.push(element.node),
    }
}

fn read<'a>(reader: &mut Reader<'a>, open: &mut Vec<Open<'a>>, out: &mut Parsed) -> Result<(), String> {
    let mut names: HashMap<String, Node> = HashMap::new();
    let mut copies = 0;
    while let Some(markup) = reader.next()? {
        let ended = match markup {
            Markup::End(tag) => match open.pop() {
                Some(last) if last.tag == tag => Some(last),
                Some(last) => return Err(format!("</{tag}> closes <{}>", last.tag)),
                None => return Err(format!("</{tag}> closes nothing")),
            },
            Markup::Start(tag, attributes, ends) => {
                if open.len() >= DEPTH_LIMIT {
                    return Err(format!("elements are nested deeper than {DEPTH_LIMIT}"));
                }
                let mut element = Open { tag, def: None, field: None, node: Node { name: tag.into(), ..Default::default() } };
                for (name, value) in attributes {
                    match name {
                        "DEF" => element.def = Some(value),
                        "containerField" => element.field = Some(value),
                        "USE" => {
                            let Some(known) = names.get(&value) else {
                                let line = reader.line();
                                out.warnings
                                    .push(format!("line {line}: USE of {value:?}, which no DEF before it names, is left out"));
                                continue;
                            };
                            copies += known.weight();
                            if copies > COPY_LIMIT {
                                return Err(format!("USE copies more than {COPY_LIMIT} nodes and numbers"));
                            }
                            element.node = known.clone();
                        }
                        _ => element.node.fields.push((name.into(), values(value))),
                    }
                }
                element.node.line = if tag.contains("Set") || tag.starts_with("Prog") { reader.line() } else { 0 };
                if tag == "ProtoInstance" {
                    out.warnings.push(format!("line {}: ProtoInstance is not expanded", reader.line()));
                }
                open.push(element);
                if ends { open.pop() } else { None }
            }
        };
        if let Some(ended) = ended {
            if let Some(name) = &ended.def {
                names.insert(name.clone(), ended.node.clone());
            }
            close(ended, open, &mut out.nodes);
        }
    }
    match open.last() {
        Some(last) => Err(format!("the file ends inside <{}>", last.tag)),
        None => Ok(()),
    }
}

/// The words of an attribute are those of a list in the classic encoding; what is none of these is a string.
fn values(text: String) -> Vec<Value> {
    let list = parse(&format!("List {{ value [ {text} ] }}"));
    match list.nodes.first() {
        Some(node) if list.error.is_none() => node.values("value").to_vec(),
        _ => vec![Value::Text(text)],
    }
}
