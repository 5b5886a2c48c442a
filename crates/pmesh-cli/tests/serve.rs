//! `pmesh serve` as its clients meet it: files, sessions, servers that are killed.

use pmesh_core::hierarchy::View;
use pmesh_view::Client;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tungstenite::{Message, WebSocket};

/// A server of a folder with a sample in it; killed at the end.
struct Server {
    process: Child,
    host: String,
}

impl Server {
    fn start(folder: &Path, args: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pmesh"));
        command
            .arg("serve")
            .arg(folder)
            .args(if args.contains(&"--port") { &["--quiet"][..] } else { &["--quiet", "--port", "0"] })
            .args(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let mut process = command.spawn().expect("it starts");
        let mut line = String::new();
        BufReader::new(process.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
        let host = line.trim().strip_prefix("http://").expect("an address").to_string();
        Self { process, host }
    }
    fn kill(&mut self) {
        self.process.kill().expect("it is killed");
        self.process.wait().expect("it ends");
    }
    fn connect(&self) -> WebSocket<TcpStream> {
        let stream = TcpStream::connect(&self.host).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(60))).expect("a limit");
        tungstenite::client(format!("ws://{}/part", self.host), stream).expect("a session").0
    }
    /// The answer to a request, head and body.
    fn get(&self, path: &str, headers: &str) -> String {
        let mut stream = TcpStream::connect(&self.host).expect("it listens");
        let request = format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n{headers}\r\n", self.host);
        stream.write_all(request.as_bytes()).expect("it takes it");
        let mut out = Vec::new();
        stream.read_to_end(&mut out).expect("it answers");
        String::from_utf8_lossy(&out).into_owned()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&path).expect("a folder can be made");
    let made = Command::new(env!("CARGO_BIN_EXE_pmesh"))
        .args(["sample", "part", "-o"])
        .arg(path.join("part.pmesh"))
        .output()
        .expect("it runs");
    assert!(made.status.success());
    path
}

fn near() -> View {
    View::look_at([0.0, 0.0, 3.0], [0.0; 3], [0.0, 1.0, 0.0], [0.4, 1.5, 0.0005]).expect("a view")
}

/// Talks until the view has all it needs; `false` if the server goes away before, which `after` messages make it.
fn settle(client: &mut Client, socket: &mut WebSocket<TcpStream>, view: &View, mut after: impl FnMut(u32)) -> bool {
    let mut received = 0;
    loop {
        let progress = client.refine(view, u32::MAX).expect("a hierarchy");
        while let Some(message) = client.poll() {
            if socket.send(Message::Binary(message.into())).is_err() {
                return false;
            }
        }
        if !client.is_waiting() {
            if progress.splits + progress.collapses == 0 {
                return true;
            }
            continue;
        }
        match socket.read() {
            Ok(Message::Binary(bytes)) => client.receive(&bytes).expect("a reply"),
            Ok(_) => continue,
            Err(_) => return false,
        }
        received += 1;
        after(received);
    }
}

#[test]
fn a_client_whose_servers_are_killed_goes_on_at_the_next() {
    let folder = folder("serve-three");
    let mut servers: Vec<Server> = (0..3).map(|_| Server::start(&folder, &["--rate", "20000"])).collect();
    let mut whole = Client::new("part");
    assert!(settle(&mut whole, &mut servers[2].connect(), &near(), |_| {}));
    let mut client = Client::new("part");
    let mut splits = Vec::new();
    for server in &mut servers[..2] {
        let mut socket = server.connect();
        // The base mesh, or that it may go on, and a packet; then the server is gone.
        let done = settle(&mut client, &mut socket, &near(), |n| {
            if n == 2 {
                server.kill()
            }
        });
        assert!(!done, "it was killed in the middle");
        splits.push(client.splits());
        client.reconnect();
    }
    assert!(splits[0] > 0 && splits[1] > splits[0], "{splits:?}");
    assert!(settle(&mut client, &mut servers[2].connect(), &near(), |_| {}));
    // Nothing is lost, and nothing came twice.
    assert_eq!(client.splits(), whole.splits());
    let shown = |c: &Client| {
        let f = c.front();
        let at = |v: u32| f.positions()[v as usize].map(f32::to_bits);
        let mut all: Vec<_> =
            f.mesh().shown().iter().filter_map(|&t| f.mesh().triangle(t)).map(|t| pmesh_core::turned(t).map(at)).collect();
        all.iter_mut()
            .for_each(|[a, b, c]| [*a, *b, *c] = [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]].into_iter().min().expect("three"));
        all.sort_unstable();
        all
    };
    assert_eq!(shown(&client), shown(&whole));
    println!("{} splits, after breaks at {splits:?}", client.splits());
    let metrics = servers[2].get("/metrics", "");
    assert!(metrics.contains("pmesh_sessions_opened_total 2"), "{metrics}");
}

#[test]
fn files_come_in_parts_and_sessions_only_to_who_may() {
    let folder = folder("serve-files");
    std::fs::write(folder.join(".hidden"), b"secret").expect("it can be written");
    let server = Server::start(&folder, &["--sessions", "1", "--message", "2048"]);
    let head = |answer: &str| answer.lines().next().unwrap_or_default().to_string();
    let whole = server.get("/part.pmesh", "");
    assert!(head(&whole).contains("200") && whole.to_lowercase().contains("accept-ranges: bytes"), "{}", head(&whole));
    assert!(whole.to_lowercase().contains("cache-control: public"));
    let part = server.get("/part.pmesh", "Range: bytes=10-19\r\n");
    assert!(head(&part).contains("206") && part.to_lowercase().contains("content-range: bytes 10-19/"), "{}", head(&part));
    assert!(head(&server.get("/health", "")).contains("200"));
    for none in ["/../Cargo.toml", "/nothing", "/", "/.hidden"] {
        let answer = server.get(none, "");
        assert!(
            head(&answer).contains("404") && answer.to_ascii_lowercase().contains("access-control-allow-origin: *"),
            "{none}"
        );
    }
    let field = |answer: &str, name: &str| {
        let line = answer.lines().find(|l| l.to_lowercase().starts_with(name)).expect("the field");
        line.split_once(':').expect("a value").1.trim().to_string()
    };
    // A download that goes on gets the rest of what it had, or the whole of what is there now.
    let same = server.get("/part.pmesh", &format!("Range: bytes=10-19\r\nIf-Range: {}\r\n", field(&whole, "last-modified")));
    assert!(head(&same).contains("206"), "{}", head(&same));
    let other = server.get("/part.pmesh", "Range: bytes=10-19\r\nIf-Range: \"other\"\r\n");
    assert!(head(&other).contains("200"), "{}", head(&other));
    assert!(!server.get("/health", "").to_lowercase().contains("cache-control"));
    let upgrade = "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    let ask = |more: &str| {
        let mut stream = TcpStream::connect(&server.host).expect("it listens");
        let request = format!("GET /part HTTP/1.1\r\nHost: {}\r\nConnection: Upgrade\r\n{upgrade}{more}\r\n", server.host);
        stream.write_all(request.as_bytes()).expect("it takes it");
        let mut line = String::new();
        BufReader::new(&stream).read_line(&mut line).expect("it answers");
        (line, stream)
    };
    assert!(ask("Origin: https://elsewhere.example\r\n").0.contains("403"));
    let (first, stream) = ask("");
    assert!(first.contains("101"), "{first}");
    assert!(ask("").0.contains("503"), "the only place is taken");
    drop(stream);
    // The place comes back.
    let mut socket = (0..100)
        .find_map(|_| {
            std::thread::sleep(Duration::from_millis(50));
            let stream = TcpStream::connect(&server.host).ok()?;
            tungstenite::client(format!("ws://{}/", server.host), stream).ok().map(|s| s.0)
        })
        .expect("a session");
    // What is no request ends the session with a reason, and nothing else.
    socket.send(Message::Binary(vec![1, 2, 3].into())).expect("it takes it");
    let Ok(Message::Binary(why)) = socket.read() else { panic!("no reason") };
    assert_eq!(why[0], 133, "{}", String::from_utf8_lossy(&why));
    assert!(head(&server.get("/health", "")).contains("200"));
}

#[test]
fn a_model_that_is_not_there_or_damaged_is_said_so() {
    let folder = folder("serve-none");
    std::fs::write(folder.join("broken.pmesh"), b"PMSH no more").expect("it can be written");
    let server = Server::start(&folder, &[]);
    for (name, says) in [("none", "no model"), ("../part", "no model"), ("broken", "cannot be read")] {
        let mut client = Client::new(name);
        let mut socket = server.connect();
        socket.send(Message::Binary(client.poll().expect("a hello").into())).expect("it takes it");
        let Ok(Message::Binary(reply)) = socket.read() else { panic!("no reason") };
        let error = client.receive(&reply).expect_err("it is none").to_string();
        assert!(error.contains(says), "{name}: {error}");
    }
    // One that is mended is there.
    std::fs::copy(folder.join("part.pmesh"), folder.join("broken.pmesh")).expect("it can be written");
    assert!(settle(&mut Client::new("broken"), &mut server.connect(), &near(), |_| {}));
}

#[test]
fn look_writes_what_is_seen_and_goes_on_after_a_break() {
    let folder = folder("serve-look");
    let mut server = Server::start(&folder, &["--rate", "15000"]);
    let port = server.host.rsplit(':').next().expect("a port").to_string();
    let look = |more: &[&str], host: &str, out: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pmesh"));
        command
            .arg("look")
            .arg(format!("ws://{host}/part"))
            .args(more)
            .arg("-o")
            .arg(folder.join(out))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command.spawn().expect("it starts")
    };
    let whole = look(&["--all"], &server.host, "whole.ply").wait_with_output().expect("it ends");
    assert!(whole.status.success());
    let text = String::from_utf8_lossy(&whole.stdout).into_owned();
    let count =
        |text: &str| text.split_once(" triangles").and_then(|t| t.0.rsplit(' ').next()?.parse::<u32>().ok()).expect("a count");
    assert!(count(&text) > 10_000, "{text}");
    let near = look(&["--eye", "0,0,3"], &server.host, "near.ply").wait_with_output().expect("it ends");
    assert!(count(&String::from_utf8_lossy(&near.stdout)) < count(&text));
    let cut = look(&["--all", "--retries", "60"], &server.host, "again.ply");
    std::thread::sleep(Duration::from_millis(1500));
    server.kill();
    let _next = Server::start(&folder, &["--port", &port]);
    let again = cut.wait_with_output().expect("it ends");
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    assert!(String::from_utf8_lossy(&again.stderr).contains("connecting again"));
    let read = |name: &str| std::fs::read(folder.join(name)).expect("a mesh").len();
    assert_eq!(read("again.ply"), read("whole.ply"));
    let nobody = look(&["--all"], "127.0.0.1:1", "none.ply").wait_with_output().expect("it ends");
    assert_eq!(nobody.status.code(), Some(1));
    assert!(!folder.join("none.ply").exists());
}

#[test]
fn the_catalogue_names_what_is_there_and_a_file_for_views_is_served_as_it_is() {
    let folder = folder("serve-catalogue");
    let run =
        |args: &[&str]| Command::new(env!("CARGO_BIN_EXE_pmesh")).current_dir(&folder).args(args).output().expect("it runs");
    std::fs::create_dir_all(folder.join("more")).expect("a folder");
    assert!(run(&["sample", "part", "-o", "more/views.pmesh", "--profile", "views", "--bits", "12"]).status.success());
    std::fs::write(folder.join(".hidden.pmesh"), "no").expect("it can be written");
    let server = Server::start(&folder, &[]);
    let list = run(&["look", &format!("ws://{}", server.host), "--list"]);
    assert_eq!(String::from_utf8_lossy(&list.stdout).trim(), "more/views\npart", "{list:?}");
    let look = |name: &str| {
        let url = format!("ws://{}/{name}", server.host);
        let output = run(&["look", &url, "--all", "-o", "seen.ply"]);
        assert!(output.status.success(), "{output:?}");
        std::fs::read(folder.join("seen.ply")).expect("a mesh").len()
    };
    // Whether the hierarchy is made here or read.
    assert_eq!(look("part"), look("more/views"));
}

#[test]
fn who_comes_back_to_another_model_is_told_that_it_is_one() {
    let folder = folder("serve-other");
    let mut server = Server::start(&folder, &[]);
    let mut client = Client::new("part");
    let mut socket = server.connect();
    settle(&mut client, &mut socket, &near(), |_| ());
    server.kill();
    let made =
        Command::new(env!("CARGO_BIN_EXE_pmesh")).current_dir(&folder).args(["sample", "knot", "-o", "part.pmesh"]).output();
    assert!(made.expect("it runs").status.success());
    let server = Server::start(&folder, &[]);
    let mut socket = server.connect();
    client.reconnect();
    socket.send(Message::Binary(client.poll().expect("a resume").into())).expect("it takes it");
    let answer = loop {
        if let Message::Binary(bytes) = socket.read().expect("an answer") {
            break client.receive(&bytes);
        }
    };
    assert!(matches!(&answer, Err(pmesh_view::ProtocolError::Refused(why)) if why.contains("changed since")), "{answer:?}");
    // What is here stays.
    assert!(client.front().mesh().shown().len() > 100);
}
