//! Running programs, with the tool cache first on PATH.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

pub type Result<T> = std::result::Result<T, String>;

/// The project's folder.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Says what comes now.
pub fn heading(text: &str) {
    println!("\n── {text}");
}

/// A program with `tools` first on its PATH.
pub fn program(name: &str, tools: &[PathBuf]) -> Command {
    let mut command = Command::new(name);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let all = tools.iter().cloned().chain(std::env::split_paths(&path));
    if let Ok(joined) = std::env::join_paths(all) {
        // Where the program itself is looked up, too.
        if let Some(found) = find(name, tools) {
            command = Command::new(found);
        }
        command.env("PATH", joined);
    }
    command
}

fn find(name: &str, folders: &[PathBuf]) -> Option<PathBuf> {
    folders.iter().map(|f| f.join(name)).find(|p| p.is_file())
}

/// True if a program of that name is on PATH.
pub fn exists(name: &str) -> bool {
    std::env::var_os("PATH").is_some_and(|p| std::env::split_paths(&p).any(|d| d.join(name).is_file()))
}

/// Runs to the end; an error says what failed.
pub fn run(command: &mut Command) -> Result<()> {
    let shown = format!("{command:?}").replace('"', "");
    let short: String = shown.split_whitespace().filter(|w| !w.starts_with("PATH=")).collect::<Vec<_>>().join(" ");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{short}` ended with {status}")),
        Err(e) => Err(format!("`{short}` cannot be run: {e}")),
    }
}

/// Runs to the end and gives what it printed, which is shown as it comes.
pub fn output_of(command: &mut Command) -> Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let failed = |e: &dyn std::fmt::Display| format!("`{name}` cannot be run: {e}");
    let mut child = command.stdout(Stdio::piped()).spawn().map_err(|e| failed(&e))?;
    let mut text = String::new();
    for line in child.stdout.take().into_iter().flat_map(|out| BufReader::new(out).lines()) {
        let line = line.map_err(|e| failed(&e))?;
        println!("{line}");
        text += &line;
        text.push('\n');
    }
    match child.wait() {
        Ok(status) if status.success() => Ok(text),
        Ok(status) => Err(format!("`{name}` ended with {status}")),
        Err(e) => Err(failed(&e)),
    }
}

/// The file of this program. Asked first when the program begins: a build may put another in its place meanwhile, and the system then calls the old one deleted.
pub fn own_path() -> Result<&'static Path> {
    static PATH: OnceLock<std::result::Result<PathBuf, String>> = OnceLock::new();
    let found = PATH.get_or_init(|| std::env::current_exe().map_err(|e| format!("this program's own file: {e}")));
    found.as_deref().map_err(Clone::clone)
}
