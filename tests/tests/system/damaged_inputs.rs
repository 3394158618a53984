//! Each kind of file that a command reads, damaged in each way that files get damaged: the damage is reported with the file's name,
//! or the answer is that of the undamaged file. A cut, a lost part or a wrong bit inside the last digits of a text without a
//! checksum leaves another valid text; the damage here is what a reader can see. Each kind of file gets twenty kinds of damage or more:
//! what happens to any bytes, and what happens to text, to tables and to a line of a log.

use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, workspace_root};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

/// One kind of file, and a command that reads it.
struct Input {
    kind: &'static str,
    /// Name of the file in the folder of the command.
    file: &'static str,
    /// What messages call it, one of these.
    called: &'static [&'static str],
    /// What surrounds the file there.
    others: Vec<(String, Vec<u8>)>,
    content: Vec<u8>,
    command: Vec<String>,
    /// Part of the output that is the answer.
    answer: fn(&Ran) -> String,
    layout: Layout,
}

/// What the bytes of a file are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    /// Numbers separated by commas.
    Table,
    /// Other text.
    Text,
    /// One of the logs of a folder, line by line.
    Log,
    Binary,
}

/// Declares the kinds of damage, and the list of all of them.
macro_rules! kinds_of_damage {
    ($($name:ident)*) => {
        /// Damage to a file, or its replacement.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        enum Damage {
            $($name),*
        }

        const DAMAGE: &[Damage] = &[$($name),*];
    };
}

kinds_of_damage! {
    Empty
    Cut
    CutInTheHead
    Doubled
    LostPart
    ZeroedBlock
    ZeroedEnd
    WrongBit
    LineEndsOfWindows
    LineEndsOfOldMacs
    ByteOrderMark
    Utf16
    ForeignText
    OtherFormat
    GermanTable
    SeparatorLine
    QuotedCells
    BlankLinesAtTheEnd
    Folder
    Missing
    NoRights
    Pipe
    Device
    Gigabyte
    LostHead
    SwappedBlocks
    PaddedEnd
}

use Damage::*;

impl Damage {
    /// Whether it can happen to such a file.
    fn befalls(self, layout: Layout) -> bool {
        match self {
            GermanTable | SeparatorLine | QuotedCells => layout == Layout::Table,
            Utf16 | BlankLinesAtTheEnd => layout != Layout::Binary,
            // Two lines of another text in the other order, or a part less, may be valid; a log has a chain of hashes.
            LostHead | SwappedBlocks | PaddedEnd => matches!(layout, Layout::Binary | Layout::Log),
            // A folder with a log less is a study with a subject less.
            Missing => layout != Layout::Log,
            // The superuser reads whatever he likes.
            NoRights => !rustix::process::geteuid().is_root(),
            _ => true,
        }
    }

    /// Puts a damaged file in place.
    fn put(self, content: &[u8], layout: Layout, path: &Path) {
        let text = || String::from_utf8(content.to_vec()).expect("a text");
        let write = |bytes: &[u8]| std::fs::write(path, bytes).expect("a scratch folder can be written to");
        let zeroed = |from: usize| {
            let mut bytes = content.to_vec();
            let to = bytes.len().min(from + 3000);
            bytes[from..to].fill(0);
            bytes
        };
        match self {
            Empty => write(b""),
            Cut => write(&content[..visible_cut(content, layout, content.len() / 2)]),
            CutInTheHead => write(&content[..visible_cut(content, layout, 12)]),
            Doubled => write(&[content, content].concat()),
            LostPart => {
                let from = visible_cut(content, layout, content.len() / 2);
                let to = match layout {
                    Layout::Binary => content.len().min(from + 1000),
                    // The line after it follows at once.
                    _ => content[from..]
                        .iter()
                        .position(|byte| *byte == b'\n')
                        .map_or(content.len(), |at| from + at + 1),
                };
                write(&[&content[..from], &content[to..]].concat());
            }
            ZeroedBlock => write(&zeroed(content.len() / 2)),
            ZeroedEnd => write(&zeroed(content.len() - content.len().min(3000) / 3)),
            WrongBit => {
                let mut bytes = content.to_vec();
                bytes[content.len() / 2] ^= 0x80;
                write(&bytes);
            }
            // Of bytes that are no text: a transfer in the mode for text.
            LineEndsOfWindows => write(&with_line_ends(content, b"\r\n")),
            LineEndsOfOldMacs => write(&with_line_ends(content, b"\r")),
            ByteOrderMark => write(&[b"\xef\xbb\xbf", content].concat()),
            Utf16 => {
                let units = std::iter::once(0xfeff).chain(text().encode_utf16().collect::<Vec<u16>>());
                write(&units.flat_map(u16::to_le_bytes).collect::<Vec<u8>>());
            }
            ForeignText => write("Sehr geehrte Damen und Herren,\nanbei die Meßdaten.\n".as_bytes()),
            OtherFormat => write(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x01\x00"),
            GermanTable => write(text().replace(',', ";").replace('.', ",").as_bytes()),
            SeparatorLine => write(format!("sep=,\n{}", text()).as_bytes()),
            QuotedCells => {
                let quoted = |line: &str| format!("\"{}\"\r\n", line.replace(',', "\",\""));
                write(text().lines().map(quoted).collect::<String>().as_bytes());
            }
            BlankLinesAtTheEnd => write(&[content, b"\n\n\n"].concat()),
            Folder => std::fs::create_dir(path).expect("a scratch folder can be written to"),
            Missing => {}
            NoRights => {
                write(content);
                let none = std::os::unix::fs::PermissionsExt::from_mode(0o0);
                std::fs::set_permissions(path, none).expect("it is ours");
            }
            Pipe => rustix::fs::mkfifoat(rustix::fs::CWD, path, rustix::fs::Mode::RUSR).expect("a pipe"),
            Device => std::os::unix::fs::symlink("/dev/zero", path).expect("a link"),
            Gigabyte => {
                let file = std::fs::File::create(path).expect("a scratch folder can be written to");
                file.set_len(1 << 30).expect("a file may have holes");
            }
            LostHead => write(&content[12..]),
            SwappedBlocks => {
                let length = (content.len() / 4).min(1000);
                let (mut bytes, middle) = (content.to_vec(), content.len() / 2);
                let (first, second) = bytes.split_at_mut(middle);
                first[middle - length..].swap_with_slice(&mut second[..length]);
                write(&bytes);
            }
            // As XMODEM pads the last block of 128 bytes.
            PaddedEnd => {
                let mut bytes = content.to_vec();
                bytes.resize((content.len() + 1).next_multiple_of(128), 0x1a);
                write(&bytes);
            }
        }
    }
}

/// Bytes with another mark in place of each line feed.
fn with_line_ends(content: &[u8], mark: &[u8]) -> Vec<u8> {
    content.split(|byte| *byte == b'\n').collect::<Vec<_>>().join(mark)
}

/// A place near `at` where a reader can see that the rest is missing: in a text after the first word or cell of a line with several.
fn visible_cut(content: &[u8], layout: Layout, at: usize) -> usize {
    if layout == Layout::Binary {
        return at;
    }
    let mut begins = (at..content.len() - 1).filter(|&at| content[at - 1] == b'\n');
    let after_the_first_part = |begin: usize| {
        let line = content[begin..].split(|byte| *byte == b'\n').next()?;
        let end = line.iter().position(|byte| b" ,".contains(byte))? + 1;
        (end < line.len() && !b"#v$".contains(&line[0])).then_some(begin + end)
    };
    begins.find_map(after_the_first_part).unwrap_or(at)
}

fn all_output(ran: &Ran) -> String {
    ran.stdout.clone()
}

fn digest(ran: &Ran) -> String {
    ran.stdout.lines().filter(|line| line.contains("digest")).collect()
}

/// What a replay found, without the time that it took.
fn finding(ran: &Ran) -> String {
    ran.stdout.lines().filter_map(|line| line.split(" in ").next()).collect()
}

fn words(text: &str) -> Vec<String> {
    text.split(' ').map(str::to_owned).collect()
}

const LOG: &str = "data/sourcedata/sub-01/sub-01_task-jnd_log.jsonl";
const POSES: &str = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0\n0.001,0,-0.004,0.1,0,0\n0,0.0005,-0.0035,0,0,0.02\n\
                     0.0002,0,-0.0025,0,0,0\n0.0001,0.0001,-0.0015,0,0.01,0\n";
const CURVE: &str = "compression_mm,force_n\n0,0\n1,0.7\n2,1.5\n3,2.2\n4,3.1\n5,4\n6,4.9\n8,6.9\n10,9.1\n";
const SCENE: &str = "duration_s = 0.02\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n[model.parameters]\n\
                     variant = \"closed-form\"\n[model.mapping]\nmotion_scale = 1.5\n";

/// A stretched sheet of four by four cells.
fn mesh() -> String {
    let vertices = (0..25)
        .map(|at| format!("v {} {} 0\n", f64::from(at % 5 - 2) * 0.005, f64::from(at / 5 - 2) * 0.005));
    let faces = (0..16).map(|cell| {
        let at = cell / 4 * 5 + cell % 4 + 1;
        format!("f {at} {} {}\nf {at} {} {}\n", at + 1, at + 6, at + 6, at + 5)
    });
    vertices.chain(faces).collect()
}

/// All files of a folder, with their names seen from another.
fn files_under(folder: &Path, from: &Path) -> Vec<(String, Vec<u8>)> {
    let entries =
        std::fs::read_dir(folder).expect("it was made").map(|entry| entry.expect("it can be read").path());
    let files = entries.flat_map(|path| match path.is_dir() {
        true => files_under(&path, from),
        false => {
            let name = path.strip_prefix(from).expect("it is in there").display().to_string();
            vec![(name, std::fs::read(&path).expect("it was made"))]
        }
    });
    files.collect()
}

/// Poses, and the force of the scene's spring at each.
fn expected_forces(scratch: &Scratch) -> String {
    let _ = scratch.file("poses", POSES);
    let command = words("eval --model spring --poses poses --out -");
    let ran = Flotor::with(command).inside(scratch.path()).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let answers = ran.stdout.lines().map(|line| line.split(',').nth(3).expect("a force along z"));
    POSES.lines().zip(answers).map(|(pose, force_n)| format!("{pose},{force_n}\n")).collect()
}

/// Every kind of file that is read, whole.
fn inputs(scratch: &Scratch) -> Vec<Input> {
    let made = |arguments: &str| {
        let ran = Flotor::with(words(arguments)).inside(scratch.path()).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{arguments}: {ran:?}");
    };
    let read = |file: &str| std::fs::read(scratch.path().join(file)).expect("it was made");
    made("run --clock virtual --duration 300ms --record run.mcap");
    made("calibrate import --out unit.toml");
    made(
        "study jnd --bases 26 --replications 2 --no-demo --feel 50ms --apparatus none --subjects 3 --out data",
    );
    let plain = |kind, file, content: &[u8], command: &str, answer, layout| Input {
        kind,
        file,
        called: &[],
        others: Vec::new(),
        content: content.to_vec(),
        command: words(command),
        answer,
        layout,
    };
    let with_poses = |kind, file, content: &[u8], command: &str, layout| Input {
        others: vec![("poses".to_owned(), POSES.as_bytes().to_vec())],
        ..plain(kind, file, content, command, all_output as fn(&Ran) -> String, layout)
    };
    let hand = "time_s,x_m,y_m,z_m\n0,0,0,0\n0.005,0,0,-0.0005\n0.01,0,0,-0.001\n0.015,0,0,-0.0015\n0.02,0,0,-0.003\n";
    let script = "grip = \"firm\"\n[[step]]\nmove = { to_mm = [0, 0, -3], duration_s = 0.01 }\n[[step]]\nhold = { duration_s = 0.01 }\n";
    let test = "scene = \"scene.toml\"\nseeds = [1, 2]\n[expect]\nlate_ticks = 0\nticks = 20\n";
    let curve_test = "scene = \"scene.toml\"\n[curve]\nfile = \"points.csv\"\nwithin_n = 1e-6\n";
    let run = "run --clock virtual --duration 20ms";
    let solid =
        std::fs::read(workspace_root().join("tests/fuzz/seeds/gmsh/tetrahedra.msh")).expect("it is there");
    let calibrated = "duration_s = 0.02\n[device]\nplugin = \"simulated\"\ncalibration = \"unit.toml\"\n[device.parameters]\n\
                      preset = \"full\"\n[[model]]\nplugin = \"spring\"\n";
    let plugin = std::fs::read(plugin_file("flotor-load")).expect("it is built");
    let points = expected_forces(scratch);
    let study = "task = \"jnd\"\n[options]\nout = \"data\"\nsubjects = 1\napparatus = \"none\"\nbases = [26]\nreplications = 2\n\
                 feel = \"50ms\"\n";
    vec![
        plain(
            "scene",
            "scene.toml",
            SCENE.as_bytes(),
            "run scene.toml --clock virtual",
            digest,
            Layout::Text,
        ),
        Input {
            others: vec![("scene.toml".to_owned(), SCENE.as_bytes().to_vec())],
            ..plain("test", "a.test.toml", test.as_bytes(), "test a.test.toml", all_output, Layout::Text)
        },
        Input {
            others: vec![
                ("scene.toml".to_owned(), SCENE.as_bytes().to_vec()),
                ("a.test.toml".to_owned(), curve_test.as_bytes().to_vec()),
            ],
            ..plain(
                "curve of a test",
                "points.csv",
                points.as_bytes(),
                "test a.test.toml",
                all_output,
                Layout::Table,
            )
        },
        plain("study", "a.study.toml", study.as_bytes(), "study run a.study.toml", all_output, Layout::Text),
        with_poses(
            "curve of a model",
            "curve.csv",
            CURVE.as_bytes(),
            "eval --model measured --set curve=curve.csv --poses poses --out -",
            Layout::Table,
        ),
        plain(
            "poses",
            "poses.csv",
            POSES.as_bytes(),
            "eval --model spring --poses poses.csv --out -",
            all_output,
            Layout::Table,
        ),
        plain(
            "measurement",
            "spring.csv",
            CURVE.as_bytes(),
            "study spring spring.csv",
            all_output,
            Layout::Table,
        ),
        plain(
            "table for the hand",
            "hand.csv",
            hand.as_bytes(),
            &format!("{run} --set device.hand_recording=hand.csv"),
            digest,
            Layout::Table,
        ),
        plain(
            "script for the hand",
            "hand.toml",
            script.as_bytes(),
            &format!("{run} --set device.hand_script=hand.toml"),
            digest,
            Layout::Text,
        ),
        with_poses(
            "mesh of a membrane",
            "mesh.obj",
            mesh().as_bytes(),
            "eval --model membrane --set file=mesh.obj --set ball_radius_mm=10 --poses poses --out -",
            Layout::Text,
        ),
        with_poses(
            "mesh of a solid",
            "body.msh",
            &solid,
            "eval --model solid --set body=file --set file=body.msh --poses poses --out -",
            Layout::Text,
        ),
        Input {
            others: vec![("scene.toml".to_owned(), calibrated.as_bytes().to_vec())],
            ..plain(
                "calibration",
                "unit.toml",
                &read("unit.toml"),
                "run scene.toml --clock virtual",
                digest,
                Layout::Text,
            )
        },
        Input {
            called: &["the recording"],
            ..plain(
                "recording, replayed",
                "run.mcap",
                &read("run.mcap"),
                "replay run.mcap",
                finding,
                Layout::Binary,
            )
        },
        plain(
            "recording for the hand",
            "run.mcap",
            &read("run.mcap"),
            &format!("{run} --set device.hand_recording=run.mcap"),
            digest,
            Layout::Binary,
        ),
        Input {
            others: files_under(&scratch.path().join("data"), scratch.path()),
            called: &["sub-01"],
            ..plain("event log", LOG, &read(LOG), "analyse data", all_output, Layout::Log)
        },
        with_poses(
            "plugin",
            "libload.so",
            &plugin,
            "eval --model ./libload.so --poses poses --out -",
            Layout::Binary,
        ),
    ]
}

/// Reads a file in a folder of its own, with a bound on memory and time.
fn read(input: &Input, put: impl FnOnce(&Path)) -> Ran {
    let scratch = Scratch::default();
    for (name, content) in &input.others {
        let path = scratch.path().join(name);
        std::fs::create_dir_all(path.parent().expect("it is in a folder")).expect("a scratch folder");
        std::fs::write(path, content).expect("a scratch folder can be written to");
    }
    let path = scratch.path().join(input.file);
    // It may be one of them.
    let _ = std::fs::remove_file(&path);
    put(&path);
    // Four gigabytes of addresses, a minute: what reads on or waits fails here.
    Flotor::with(&input.command)
        .through_shell("ulimit -v 4000000; exec timeout -s KILL 60 \"$@\"")
        .inside(scratch.path())
        .run()
}

/// What is wrong with the outcome of reading a damaged file.
fn complaint(input: &Input, ran: &Ran, expected: &str) -> Option<String> {
    let is_read_right = ran.code == Some(exit_code::OK) && (input.answer)(ran) == expected;
    let is_failure = ran.code.is_some_and(|code| (1..=4).contains(&code));
    let output = [ran.stdout.as_str(), ran.stderr.as_str()].concat();
    let names_it =
        |line: &str| line.contains(input.file) || input.called.iter().any(|name| line.contains(name));
    let says = |word: &str| output.lines().any(|line| line.contains(word) && names_it(line));
    // A sitting that is not complete is left out with a note, and the note of a truncated recording stands with its ticks.
    let is_reported = (is_failure && says("error: ") || says("note")) && !output.contains("panicked");
    let said = |text: &str| text.chars().take(300).collect::<String>();
    (!is_read_right && !is_reported)
        .then(|| format!("{:?} {} / {}", ran.code, said(&ran.stderr), said(&(input.answer)(ran))))
}

#[test]
fn each_kind_of_file_gets_twenty_kinds_of_damage() {
    for layout in [Layout::Table, Layout::Text, Layout::Log, Layout::Binary] {
        let kinds: Vec<_> = DAMAGE.iter().filter(|damage| damage.befalls(layout)).collect();
        println!("{layout:?}: {} kinds of damage: {kinds:?}", kinds.len());
        assert!(kinds.len() >= 20, "{layout:?}: {kinds:?}");
    }
}

#[test]
fn damage_to_any_file_is_reported_or_does_no_harm() {
    let scratch = Scratch::default();
    let inputs = inputs(&scratch);
    let answers: Vec<String> = inputs
        .par_iter()
        .map(|input| {
            let ran = read(input, |path| std::fs::write(path, &input.content).expect("a scratch folder"));
            assert_eq!(ran.code, Some(exit_code::OK), "{}: {ran:?}", input.kind);
            let answer = (input.answer)(&ran);
            assert!(!answer.trim().is_empty(), "{}: {ran:?}", input.kind);
            answer
        })
        .collect();
    let stride = if TestSize::of_this_run().leaves_out_long_tests() { 5 } else { 1 };
    let tries: Vec<(usize, Damage)> = (0..inputs.len())
        .flat_map(|index| DAMAGE.iter().map(move |&damage| (index, damage)))
        .filter(|(index, damage)| damage.befalls(inputs[*index].layout))
        .step_by(stride)
        .collect();
    let outcomes: Vec<(usize, Result<bool, String>)> = tries
        .par_iter()
        .map(|&(index, damage)| {
            let input = &inputs[index];
            let ran = read(input, |path| damage.put(&input.content, input.layout, path));
            let outcome = match complaint(input, &ran, &answers[index]) {
                None => Ok(ran.code == Some(exit_code::OK)),
                Some(said) => Err(format!("{}, {damage:?}: {said}", input.kind)),
            };
            (index, outcome)
        })
        .collect();
    let mut counts: BTreeMap<&str, [usize; 3]> = BTreeMap::new();
    let mut wrong = Vec::new();
    for (index, outcome) in outcomes {
        let count = counts.entry(inputs[index].kind).or_default();
        match outcome {
            Ok(false) => count[0] += 1,
            Ok(true) => count[1] += 1,
            Err(said) => {
                count[2] += 1;
                wrong.push(said);
            }
        }
    }
    for (kind, [reported, read, wrong]) in &counts {
        println!(
            "{kind}: {} kinds of damage, {reported} reported, {read} read right, {wrong} wrong",
            reported + read + wrong
        );
    }
    let sum = |part: usize| counts.values().map(|count| count[part]).sum::<usize>();
    println!("all files: {} reported, {} read right, {} wrong", sum(0), sum(1), sum(2));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(sum(0) > 0 && sum(1) > 0, "both outcomes were met");
}
