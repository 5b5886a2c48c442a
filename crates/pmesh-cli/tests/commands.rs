//! The command as a user runs it: what it says, what it writes, how it ends.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder of its own for each test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&path).expect("a folder can be made");
    path
}

fn pmesh(folder: &Path, args: &str) -> Output {
    let command = Command::new(env!("CARGO_BIN_EXE_pmesh")).current_dir(folder).args(args.split(' ')).output();
    command.expect("it runs")
}

/// What it prints, if all went well.
fn printed(folder: &Path, args: &str) -> String {
    let output = pmesh(folder, args);
    assert!(output.status.success(), "{args}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("it is text")
}

/// The number before a word.
fn count(text: &str, what: &str) -> u32 {
    let words: Vec<&str> = text.split([' ', ',']).filter(|w| !w.is_empty()).collect();
    let at = words.iter().position(|w| w.trim() == what).unwrap_or_else(|| panic!("no {what} in {text}"));
    words[at - 1].parse().expect("a number")
}

#[test]
fn a_wrong_command_line_ends_with_2_and_a_bad_file_with_1() {
    let at = folder("exit-codes");
    std::fs::write(at.join("triangle.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("it can be written");
    std::fs::write(at.join("broken.obj"), "v 0 0\n").expect("it can be written");
    let wrong = [
        "encode triangle.obj -o out.pmesh --levels 0",
        "encode triangle.obj -o out.pmesh --growth 1",
        "encode triangle.obj -o out.stl",
        "encode triangle.obj -o triangle.obj",
        "sample teapot -o out.pmesh",
    ];
    for (args, code) in wrong.iter().map(|w| (*w, 2)).chain([
        ("encode broken.obj -o out.pmesh", 1),
        ("encode missing.obj -o out.pmesh", 1),
        ("info triangle.obj", 1),
        ("encode triangle.obj -o out.pmesh", 0),
    ]) {
        let output = pmesh(&at, args);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{args}: {said}");
        assert!(code == 0 || said.starts_with("error: "), "{args}: {said}");
    }
}

#[test]
fn what_a_cut_file_holds_is_shown_and_written_down_to_the_last_split() {
    let at = folder("cut");
    printed(&at, "sample knot -o knot.pmesh");
    let whole = std::fs::read(at.join("knot.pmesh")).expect("it was written");
    std::fs::write(at.join("cut.pmesh"), &whole[..whole.len() / 2]).expect("it can be written");
    let info = pmesh(&at, "info cut.pmesh");
    let text = String::from_utf8_lossy(&info.stdout);
    assert_eq!(info.status.code(), Some(1));
    assert!(text.contains(&format!("bytes       {} of {}", whole.len() / 2, whole.len())), "{text}");
    let level = count(&text, "vertices");
    assert_eq!(pmesh(&at, "decode cut.pmesh -o cut.ply").status.code(), Some(1));
    let kept = printed(&at, "decode cut.pmesh -o cut.ply --keep-going");
    let prefix = printed(&at, &format!("decode knot.pmesh -o prefix.ply --prefix {}", whole.len() / 2));
    assert!(count(&kept, "vertices") > level, "{kept}");
    assert_eq!(kept.replace("cut.ply", ""), prefix.replace("prefix.ply", ""));
    assert_eq!(std::fs::read(at.join("cut.ply")).ok(), std::fs::read(at.join("prefix.ply")).ok());
}

#[test]
fn a_large_model_that_is_no_surface_is_written_for_speed_and_says_so() {
    let at = folder("soup");
    let triangle = |i: usize| {
        let (x, y) = (i % 90 * 3, i / 90 * 3);
        format!("v {x} {y} 0\nv {} {y} 1\nv {x} {} 2\nf -3 -2 -1\n", x + 1, y + 1)
    };
    std::fs::write(at.join("soup.obj"), (0..7_000).map(triangle).collect::<String>()).expect("it can be written");
    let output = pmesh(&at, "encode soup.obj -o soup.pmesh");
    assert!(String::from_utf8_lossy(&output.stderr).contains("fast"), "{output:?}");
    assert!(printed(&at, "info soup.pmesh").contains("pmesh 0"));
    printed(&at, "encode soup.obj -o compact.pmesh --profile prefix");
    assert!(printed(&at, "info compact.pmesh").contains("compact, pmesh 1"));
}

#[test]
fn converting_keeps_levels_that_sharpen() {
    let at = folder("convert");
    printed(&at, "sample knot -o knot.pmesh");
    let first = printed(&at, "info knot.pmesh");
    assert!(first.contains("places of vertices that move between levels"), "{first}");
    let copied = pmesh(&at, "convert knot.pmesh -o copy.pmesh");
    assert!(copied.status.success() && copied.stderr.is_empty(), "{copied:?}");
    assert_eq!(std::fs::read(at.join("copy.pmesh")).ok(), std::fs::read(at.join("knot.pmesh")).ok());
    for name in ["knot.lod", "knot-fast.pmesh --profile fast"] {
        let output = pmesh(&at, &format!("convert knot.pmesh -o {name}"));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && !said.contains("made anew"), "{name}: {said}");
        let file = name.split(' ').next().unwrap_or_default();
        let converted = printed(&at, &format!("info {file}"));
        assert_eq!(count(&converted, "vertices"), count(&first, "vertices"));
        // Level, vertices, triangles: the table without its bytes.
        let levels = |text: &str| -> Vec<String> {
            let rows = text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>()).filter(|w| w.len() == 7 && w[3] == "%");
            rows.map(|w| [w[0], w[4], w[5]].join(" ")).collect()
        };
        assert!(levels(&converted).len() > 5, "{converted}");
        assert_eq!(levels(&converted), levels(&first));
    }
}

#[test]
fn a_file_for_views_is_a_mesh_again_and_says_what_it_is() {
    let at = folder("views");
    let colors = pmesh(&at, "sample marble -o marble.pmesh --profile views");
    assert!(String::from_utf8_lossy(&colors.stderr).contains("colours are not carried"), "what is left out is told: {colors:?}");
    printed(&at, "sample part -o part.ply");
    let said = pmesh(&at, "encode part.ply -o part.pmesh --profile views --bits 12");
    assert!(said.status.success() && said.stderr.is_empty(), "{said:?}");
    let line = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(count(&line, "splits") > 1000, "{line}");
    let info = printed(&at, "info part.pmesh");
    assert!(info.contains("for views") && info.contains("12 bits a coordinate"), "{info}");
    let triangles = count(&printed(&at, "sample part -o again.ply"), "triangles");
    assert_eq!(count(&printed(&at, "decode part.pmesh -o back.obj"), "triangles"), triangles);
    printed(&at, "convert part.pmesh -o plain.pmesh");
    assert!(printed(&at, "info plain.pmesh").contains("compact"));
    let bytes = std::fs::read(at.join("part.pmesh")).expect("it was written");
    std::fs::write(at.join("cut.pmesh"), &bytes[..bytes.len() - 9]).expect("it can be written");
    let cut = pmesh(&at, "decode cut.pmesh -o cut.obj");
    assert!(cut.status.code() == Some(1) && String::from_utf8_lossy(&cut.stderr).contains("in the middle of a block"), "{cut:?}");
}
