//! A scene as a tree of nodes, whatever it was written in: VRML97 and X3D's classic text here, X3D's XML in `x3d`.

/// A value of a field.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number.
    Number(f64),
    /// TRUE, FALSE, NULL, a name.
    Word(String),
    /// A quoted string.
    Text(String),
    /// A node.
    Node(Node),
}

/// A node with its fields in the order of the file; lists are flat.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Its type.
    pub name: String,
    /// Its fields.
    pub fields: Vec<(String, Vec<Value>)>,
    /// Line it begins at.
    pub line: u64,
}

impl Node {
    /// All values of a field, empty if it has none.
    pub fn values(&self, field: &str) -> &[Value] {
        self.fields.iter().find(|f| f.0 == field).map_or(&[], |f| &f.1)
    }
    /// The numbers of a field.
    pub fn numbers(&self, field: &str) -> Vec<f64> {
        self.values(field).iter().filter_map(|v| if let Value::Number(n) = v { Some(*n) } else { None }).collect()
    }
    /// The numbers of a field in which nothing else may stand.
    pub fn only_numbers(&self, field: &str) -> Result<Vec<f64>, String> {
        let other = self.values(field).iter().find(|v| !matches!(v, Value::Number(_)));
        match other {
            Some(Value::Word(w) | Value::Text(w)) => Err(format!("{w:?} stands among the numbers of {field}")),
            Some(_) => Err(format!("a node stands among the numbers of {field}")),
            None => Ok(self.numbers(field)),
        }
    }
    /// Nodes and values here and below.
    pub(super) fn weight(&self) -> usize {
        self.all().iter().map(|n| 1 + n.fields.iter().map(|f| f.1.len()).sum::<usize>()).sum()
    }
    /// The nodes of a field.
    pub fn nodes(&self, field: &str) -> impl Iterator<Item = &Node> {
        self.values(field).iter().filter_map(|v| if let Value::Node(n) = v { Some(n) } else { None })
    }
    /// The strings of a field.
    pub fn texts(&self, field: &str) -> Vec<&str> {
        self.values(field).iter().filter_map(|v| if let Value::Text(t) = v { Some(t.as_str()) } else { None }).collect()
    }
    /// A field that is TRUE or FALSE.
    pub fn flag(&self, field: &str, default: bool) -> bool {
        match self.values(field).first() {
            Some(Value::Word(w)) => w.eq_ignore_ascii_case("true"),
            _ => default,
        }
    }
    /// Every node below and this one.
    pub fn all(&self) -> Vec<&Node> {
        let mut out = vec![self];
        let mut at = 0;
        while at < out.len() {
            let node: &Node = out[at];
            out.extend(node.fields.iter().flat_map(|f| &f.1).filter_map(|v| if let Value::Node(n) = v { Some(n) } else { None }));
            at += 1;
        }
        out
    }
}

/// Deepest nesting of nodes.
const DEPTH_LIMIT: usize = 64;
/// Most nodes and values that USE may copy.
pub(super) const COPY_LIMIT: usize = 2_000_000;

/// What parsing gave: the nodes that are whole, oddities, and what ended it early.
#[derive(Clone, Debug, Default)]
pub struct Parsed {
    /// The scene's nodes.
    pub nodes: Vec<Node>,
    /// Names that PROTO and EXTERNPROTO declare.
    pub protos: Vec<String>,
    /// What is odd but was read.
    pub warnings: Vec<String>,
    /// (line, what is wrong); the nodes before it, and the whole parts of the one it is in, are there.
    pub error: Option<(u64, String)>,
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Open,
    Close,
    ListOpen,
    ListClose,
    Number(f64),
    Word(String),
    Text(String),
}

impl std::fmt::Display for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Token::Open => f.write_str("{"),
            Token::Close => f.write_str("}"),
            Token::ListOpen => f.write_str("["),
            Token::ListClose => f.write_str("]"),
            Token::Number(n) => write!(f, "{n}"),
            Token::Word(w) => f.write_str(w),
            Token::Text(t) => write!(f, "{t:?}"),
        }
    }
}

struct Tokens<'a> {
    rest: &'a str,
    line: u64,
}

impl Tokens<'_> {
    fn skip(&mut self) {
        loop {
            let trimmed = self.rest.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
            self.line += self.rest[..self.rest.len() - trimmed.len()].matches('\n').count() as u64;
            self.rest = trimmed;
            if !self.rest.starts_with('#') {
                return;
            }
            let end = self.rest.find(['\n', '\r']).unwrap_or(self.rest.len());
            self.rest = &self.rest[end..];
        }
    }
    fn next(&mut self) -> Option<Token> {
        self.skip();
        let first = self.rest.chars().next()?;
        let single = match first {
            '{' => Some(Token::Open),
            '}' => Some(Token::Close),
            '[' => Some(Token::ListOpen),
            ']' => Some(Token::ListClose),
            _ => None,
        };
        if let Some(token) = single {
            self.rest = &self.rest[1..];
            return Some(token);
        }
        if first == '"' {
            let mut text = String::new();
            let mut chars = self.rest[1..].char_indices();
            while let Some((i, c)) = chars.next() {
                match c {
                    '"' => {
                        self.rest = &self.rest[i + 2..];
                        return Some(Token::Text(text));
                    }
                    '\\' => text.extend(chars.next().map(|c| c.1)),
                    c => {
                        self.line += u64::from(c == '\n');
                        text.push(c);
                    }
                }
            }
            self.rest = "";
            return None;
        }
        let end = self.rest.find(|c: char| c.is_whitespace() || "{}[],\"#".contains(c)).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        let hex = word.strip_prefix("0x").or(word.strip_prefix("0X")).and_then(|h| u32::from_str_radix(h, 16).ok());
        if let Some(number) = hex {
            return Some(Token::Number(number.into()));
        }
        let number = word.parse::<f64>().ok().filter(|_| word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)));
        Some(number.map_or_else(|| Token::Word(word.into()), Token::Number))
    }
    fn peek(&mut self) -> Option<Token> {
        let (rest, line) = (self.rest, self.line);
        let token = self.next();
        (self.rest, self.line) = (rest, line);
        token
    }
}

struct Parser<'a> {
    tokens: Tokens<'a>,
    names: std::collections::HashMap<String, Node>,
    copies: usize,
    protos: Vec<String>,
    warnings: Vec<String>,
}

type Failure = (u64, String);

/// Parses VRML97 or X3D's classic encoding. PROTO and EXTERNPROTO declarations are passed over. O(length), and what USE copies.
pub fn parse(text: &str) -> Parsed {
    let mut parser = Parser {
        tokens: Tokens { rest: text, line: 1 },
        names: Default::default(),
        copies: 0,
        protos: Vec::new(),
        warnings: Vec::new(),
    };
    let mut out = Parsed::default();
    while let Some(token) = parser.tokens.next() {
        let Token::Word(word) = token else {
            out.error = Some((parser.tokens.line, format!("a node was expected, not {token}")));
            break;
        };
        match parser.statement(&word, &mut out.nodes) {
            Ok(()) => {}
            Err(failure) => {
                out.error = Some(failure);
                break;
            }
        }
    }
    out.warnings = parser.warnings;
    out.protos = parser.protos;
    out
}

impl Parser<'_> {
    fn fail<T>(&self, what: impl Into<String>) -> Result<T, Failure> {
        Err((self.tokens.line, what.into()))
    }

    fn statement(&mut self, word: &str, out: &mut Vec<Node>) -> Result<(), Failure> {
        match word {
            "PROTO" | "EXTERNPROTO" => {
                // Name, interface, then a body or URLs.
                if let Some(Token::Word(name)) = self.tokens.next() {
                    self.protos.push(name);
                }
                self.balanced()?;
                if matches!(self.tokens.peek(), Some(Token::Open | Token::ListOpen)) { self.balanced() } else { self.skip_one() }
            }
            "ROUTE" | "PROFILE" | "COMPONENT" | "META" | "IMPORT" | "EXPORT" | "UNIT" => {
                let count = match word {
                    "ROUTE" => 3,
                    "META" | "UNIT" => 2,
                    _ => 1,
                };
                (0..count).try_for_each(|_| self.skip_one())
            }
            _ => {
                let mut node = Node::default();
                let result = self.node(word, 0, &mut node);
                // What is whole of a node that is cut short counts.
                out.push(node);
                result
            }
        }
    }
    fn skip_one(&mut self) -> Result<(), Failure> {
        match self.tokens.next() {
            Some(_) => Ok(()),
            None => self.fail("the file ends inside a statement"),
        }
    }
    /// Passes over a bracket and all in it.
    fn balanced(&mut self) -> Result<(), Failure> {
        let mut depth = 0;
        loop {
            match self.tokens.next() {
                Some(Token::Open | Token::ListOpen) => depth += 1,
                Some(Token::Close | Token::ListClose) => depth -= 1,
                Some(_) if depth > 0 => {}
                Some(_) => return self.fail("a bracket was expected"),
                None => return self.fail("the file ends inside a declaration"),
            }
            if depth <= 0 {
                return Ok(());
            }
        }
    }

    /// A node of which the first word is read: its type, or DEF or USE.
    fn node(&mut self, word: &str, depth: usize, node: &mut Node) -> Result<(), Failure> {
        if depth > DEPTH_LIMIT {
            return self.fail(format!("nodes are nested deeper than {DEPTH_LIMIT}"));
        }
        node.line = self.tokens.line;
        match word {
            "USE" => {
                let Some(Token::Word(name)) = self.tokens.next() else { return self.fail("USE needs a name") };
                let Some(known) = self.names.get(&name) else {
                    // A script may USE the node that it stands in.
                    self.warnings
                        .push(format!("line {}: USE of {name:?}, which no DEF before it names, is left out", self.tokens.line));
                    return Ok(());
                };
                self.copies += known.weight();
                if self.copies > COPY_LIMIT {
                    return self.fail(format!("USE copies more than {COPY_LIMIT} nodes and numbers"));
                }
                *node = known.clone();
                Ok(())
            }
            "DEF" => {
                let (Some(Token::Word(name)), Some(Token::Word(kind))) = (self.tokens.next(), self.tokens.next()) else {
                    return self.fail("DEF needs a name and a node");
                };
                self.node(&kind, depth + 1, node)?;
                self.names.insert(name, node.clone());
                Ok(())
            }
            kind => {
                node.name = kind.into();
                match self.tokens.next() {
                    Some(Token::Open) => self.fields(depth, node),
                    Some(other) => self.fail(format!("{kind:?} is followed by {other}, not by a node's {{")),
                    None => self.fail(format!("the file ends after {kind:?}")),
                }
            }
        }
    }

    fn fields(&mut self, depth: usize, node: &mut Node) -> Result<(), Failure> {
        loop {
            match self.tokens.next() {
                Some(Token::Close) => return Ok(()),
                Some(Token::Word(field)) if field == "ROUTE" => (0..3).try_for_each(|_| self.skip_one())?,
                Some(Token::Word(field)) => self.field(field, depth, node)?,
                Some(other) => return self.fail(format!("a field of {} was expected, not {other}", node.name)),
                None => return self.fail(format!("the file ends inside {}", node.name)),
            }
        }
    }

    fn field(&mut self, field: String, depth: usize, node: &mut Node) -> Result<(), Failure> {
        let mut values = Vec::new();
        let result = match self.tokens.next() {
            Some(Token::ListOpen) => self.list(depth, &mut values, node),
            Some(Token::Word(word)) => self.word(word, depth, &mut values),
            Some(Token::Number(n)) => {
                values.push(Value::Number(n));
                // SFVec3f and its like: all numbers that follow.
                while let Some(Token::Number(n)) = self.tokens.peek() {
                    self.tokens.next();
                    values.push(Value::Number(n));
                }
                Ok(())
            }
            Some(Token::Text(text)) => {
                values.push(Value::Text(text));
                Ok(())
            }
            _ => self.fail(format!("the field {field} has no value")),
        };
        node.fields.push((field, values));
        result
    }

    fn word(&mut self, word: String, depth: usize, values: &mut Vec<Value>) -> Result<(), Failure> {
        let is_node = matches!(word.as_str(), "DEF" | "USE") || self.tokens.peek() == Some(Token::Open);
        if !is_node {
            values.push(Value::Word(word));
            return Ok(());
        }
        let mut inner = Node::default();
        let result = self.node(&word, depth + 1, &mut inner);
        values.push(Value::Node(inner));
        result
    }

    fn list(&mut self, depth: usize, values: &mut Vec<Value>, node: &mut Node) -> Result<(), Failure> {
        loop {
            match self.tokens.next() {
                Some(Token::ListClose) => return Ok(()),
                Some(Token::Number(n)) => values.push(Value::Number(n)),
                Some(Token::Text(text)) => values.push(Value::Text(text)),
                Some(Token::Word(word)) => {
                    // As FC01's Figure 5 is printed: fields of the node inside a list of its nodes (C.11).
                    let damaged = !matches!(word.as_str(), "DEF" | "USE" | "TRUE" | "FALSE" | "NULL")
                        && matches!(self.tokens.peek(), Some(Token::Word(_) | Token::ListOpen));
                    if damaged && depth < DEPTH_LIMIT {
                        let line = self.tokens.line;
                        self.warnings
                            .push(format!("line {line}: the field {word} stands inside a list; it is read as {}'s", node.name));
                        self.field(word, depth + 1, node)?;
                    } else {
                        self.word(word, depth, values)?;
                    }
                }
                Some(other) => return self.fail(format!("a list cannot hold {other}")),
                None => return self.fail("the file ends inside a list"),
            }
        }
    }
}
