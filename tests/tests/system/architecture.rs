//! The shape of the workspace, held by tests: who may depend on whom, where `unsafe` may stand, and that every
//! dependency has a reason.
//!
//! Each rule is a function from facts to complaints, so that it is tested twice: on the workspace, where it
//! must find nothing, and on a made-up offence, which it must find.

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand};
use flotor_tests::{TestSize, files_under, workspace_root};
use proc_macro2::{TokenStream, TokenTree};
use std::path::Path;
use std::process;

// ---------------------------------------------------------------- dependencies point one way

/// What a crate is for, told by the folder it lives in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Contract,
    /// What a host loads plugins with.
    Loader,
    Plugin,
    /// What several device plugins share.
    OfDevices,
    /// What formulas of model plugins are written in.
    OfModels,
    /// The other end of a device's link, without hardware.
    Emulator,
    /// What several emulators share.
    OfEmulators,
    Sync,
    /// Plain data and maths of a run.
    Core,
    /// Numbers only: the force of a set of contacts.
    Contact,
    /// Two devices held together.
    Coupling,
    /// The real-time core.
    Servo,
    /// Reads MCAP files.
    Container,
    Record,
    /// What host and observers say to each other.
    Live,
    /// Embeds Flotor in a program.
    Session,
    /// What the libraries that stand in for other makers' share.
    Compat,
    /// A library that answers where a program calls another maker's.
    DropIn,
    /// A program that answers where a program calls another maker's service.
    Service,
    /// Runs programs of other makers.
    Lend,
    /// Knows numbers only.
    Statistics,
    /// Draws, and knows nothing of what.
    Plot,
    /// Triangles and pictures of them, without a window.
    Drawing,
    /// Samples of a run over time.
    History,
    /// What the programs share: options, output, errors.
    Command,
    /// Judges models and devices.
    Judge,
    Lab,
    /// An allocator for one process of the lab.
    Guard,
    Calibration,
    /// Finds the law of a real object.
    Identify,
    /// Judges runs from outside.
    SceneTest,
    /// Designs of experiments, without input and output.
    StudyDesign,
    Study,
    /// Results from logs.
    Analysis,
    StudyProgram,
    Host,
    Viewer,
    Tests,
    /// A plugin that is wrong on purpose, for the tests.
    Fixture,
}

use Role::{
    Analysis, Calibration, Command, Compat, Contact, Container, Contract, Core, Coupling, Drawing, DropIn,
    Emulator, Fixture, Guard, History, Host, Identify, Judge, Lab, Lend, Live, Loader, OfDevices,
    OfEmulators, OfModels, Plot, Plugin, Record, SceneTest, Service, Servo, Session, Statistics, Study,
    StudyDesign, StudyProgram, Sync, Tests, Viewer,
};

/// The folders of the crates that have one of their own, and the roles each may depend on.
const CRATES: &[(&str, Role, &[Role])] = &[
    ("hal", Contract, &[]),
    ("hal/loader", Loader, &[Contract]),
    ("devices/force-switch", OfDevices, &[Contract]),
    ("devices/serial", OfDevices, &[]),
    ("devices/vendor-sdk", OfDevices, &[Contract]),
    ("models/lanes", OfModels, &[Contract]),
    ("devices/usbip", OfEmulators, &[Contract]),
    ("devices/emulation", OfEmulators, &[Contract]),
    ("host/sync", Sync, &[]),
    ("host/core", Core, &[Contract, Sync]),
    // The core for the random numbers of its tests.
    ("host/contact", Contact, &[Contract, Core]),
    ("host/coupling", Coupling, &[Contract, Sync, Core]),
    ("host/servo", Servo, &[Contract, Loader, Sync, Core, Contact, Coupling]),
    ("devices/mcap", Container, &[]),
    ("host/record", Record, &[Contract, Sync, Core, Container]),
    ("host/live", Live, &[Contract, Sync, Core, Record]),
    ("host/session", Session, &[Contract, Loader, Sync, Core, Coupling, Servo, Record, Live]),
    ("interop/compat/common", Compat, &[Contract, Sync, Core, Servo, Record, Live, Session]),
    ("interop/compat/chai3d", DropIn, &[Contract, Compat]),
    ("interop/compat/openhaptics", DropIn, &[Contract, Compat]),
    ("interop/compat/dhd", DropIn, &[Contract, Compat]),
    ("interop/compat/haply", Service, &[Contract, Core, Compat, Command, OfEmulators]),
    ("interop/lend", Lend, &[Servo, Session, Command]),
    ("study/statistics", Statistics, &[]),
    ("host/plot", Plot, &[]),
    ("host/command", Command, &[Contract, Loader, Sync, Core, Servo, Record, Live, Session]),
    ("lab/guard", Guard, &[]),
    ("lab/judge", Judge, &[Contract, Loader, Core, Contact, Session, Plot]),
    (
        "lab/measure",
        Lab,
        &[Contract, Loader, Sync, Core, Coupling, Servo, Record, Live, Session, Plot, Command, Judge],
    ),
    (
        "lab/calibration",
        Calibration,
        &[Contract, Loader, Sync, Core, Servo, Record, Live, Session, Plot, Command],
    ),
    ("lab/identify", Identify, &[Contract, Record, Plot, Command]),
    // Neither the session nor the loader: everything it runs is a process of its own.
    ("lab/scene-test", SceneTest, &[Contract, Core, Plot, Command]),
    ("study/design", StudyDesign, &[Statistics]),
    ("study/core", Study, &[Contract, Sync, Core, Servo, Record, Live, Session, Statistics, StudyDesign]),
    ("study/analysis", Analysis, &[Core, Statistics, StudyDesign, Study]),
    (
        "study/program",
        StudyProgram,
        &[
            Contract,
            Loader,
            Sync,
            Core,
            Servo,
            Record,
            Live,
            Session,
            Plot,
            Statistics,
            Command,
            StudyDesign,
            Study,
            Analysis,
        ],
    ),
    // The plugins only as paths, so that one `cargo run` builds them; no line of the host names them.
    (
        "host",
        Host,
        &[Contract, Loader, Sync, Core, Coupling, Servo, Record, Live, Session, Plot, Command, Plugin],
    ),
    ("viewer/drawing", Drawing, &[Contract]),
    ("viewer/history", History, &[Contract, Sync, Core, Record, Plot]),
    ("viewer", Viewer, &[Contract, Loader, Sync, Core, Record, Live, Plot, Drawing, History, Study]),
    // What it may use is listed in `Role::may_use`.
    ("tests", Tests, &[]),
];

impl Role {
    fn of_folder(folder: &str) -> Option<Self> {
        let listed = CRATES.iter().find(|(of, ..)| *of == folder);
        Some(match folder {
            _ if listed.is_some() => listed?.1,
            "tests/instructions" => Tests,
            _ if folder.starts_with("tests/fixtures/") => Fixture,
            _ if folder.starts_with("devices/") && folder.ends_with("/emulator") => Emulator,
            _ if folder.starts_with("devices/") || folder.starts_with("models/") => Plugin,
            _ => return None,
        })
    }

    /// Whether a crate of this role may depend on one of another.
    fn may_use(self, other: Role) -> bool {
        match self {
            Plugin => matches!(other, Contract | OfDevices | OfModels | Container),
            Fixture => other == Contract,
            Emulator => matches!(other, Contract | Loader | Plugin | OfEmulators),
            Tests => {
                !matches!(other, OfDevices | OfEmulators | OfModels | Container | Compat | Service | Tests)
            }
            _ => CRATES.iter().any(|(_, role, used)| *role == self && used.contains(&other)),
        }
    }
}

/// One crate of the workspace, as far as the rules look at it.
struct Member {
    name: String,
    role: Role,
    uses: Vec<Use>,
}

/// One dependency of a member on another member.
struct Use {
    name: String,
    role: Role,
}

fn workspace_members(metadata: &Metadata) -> Vec<Member> {
    let folder = |manifest_folder: &Path| {
        let relative = manifest_folder.strip_prefix(metadata.workspace_root.as_std_path());
        relative.unwrap_or(manifest_folder).display().to_string()
    };
    let role = |name: &str, manifest_folder: &Path| {
        let folder = folder(manifest_folder);
        Role::of_folder(&folder)
            .unwrap_or_else(|| panic!("{name} lives in `{folder}`: give that folder a role"))
    };
    let member = |package: &cargo_metadata::Package| {
        let own_folder = package.manifest_path.as_std_path().parent().unwrap_or(Path::new(""));
        let uses = package.dependencies.iter().filter_map(|dependency| {
            let folder = dependency.path.as_ref()?.as_std_path();
            let role = role(&dependency.name, folder);
            // Examples and tests may link a plugin in, load it as a host does, and solve its contacts as the loop does.
            let is_linked_in =
                dependency.kind == DependencyKind::Development && matches!(role, Plugin | Loader | Contact);
            (!is_linked_in).then(|| Use { name: dependency.name.clone(), role })
        });
        Member { name: package.name.to_string(), role: role(&package.name, own_folder), uses: uses.collect() }
    };
    metadata.workspace_packages().into_iter().map(member).collect()
}

/// Dependencies that point the wrong way.
fn wrong_dependencies(members: &[Member]) -> Vec<String> {
    let mut complaints = Vec::new();
    for member in members {
        for used in &member.uses {
            if !member.role.may_use(used.role) {
                complaints.push(format!(
                    "{} ({:?}) depends on {} ({:?})",
                    member.name, member.role, used.name, used.role
                ));
            }
            // The simulated flotor has the coils and the sensors of every levitated device.
            let is_foreign = used.role == Role::Plugin
                && used.name != "flotor-simulated"
                && member.name != format!("{}-emulator", used.name);
            if member.role == Role::Emulator && is_foreign {
                complaints.push(format!("{} uses {}, which it does not emulate", member.name, used.name));
            }
        }
    }
    complaints
}

fn metadata() -> Metadata {
    metadata_of(".")
}

/// Returns the members of a workspace with their dependencies.
pub(super) fn metadata_of(workspace: &str) -> Metadata {
    let mut command = MetadataCommand::new();
    command.manifest_path(workspace_root().join(workspace).join("Cargo.toml")).no_deps();
    command.other_options(vec!["--offline".to_owned()]);
    command.exec().expect("cargo metadata reads the workspace")
}

#[test]
fn dependencies_point_one_way() {
    let members = workspace_members(&metadata());
    let with_role = |role| members.iter().filter(move |member| member.role == role).count();
    assert_eq!(with_role(Role::Contract), 1);
    assert_eq!(with_role(Role::Host), 1);
    assert!(with_role(Role::Plugin) >= 3);
    assert_eq!(wrong_dependencies(&members), Vec::<String>::new());
}

#[test]
fn a_plugin_that_uses_the_host_is_noticed() {
    let complaints = |user: &str, user_role, used: &str, role| {
        let uses = vec![Use { name: used.to_owned(), role }];
        wrong_dependencies(&[Member { name: user.to_owned(), role: user_role, uses }]).len()
    };
    assert_eq!(complaints("flotor-wall", Role::Plugin, "flotor-hal", Role::Contract), 0);
    assert_eq!(complaints("flotor-wall", Role::Plugin, "flotor", Role::Host), 1);
    assert_eq!(complaints("flotor-wall", Role::Plugin, "flotor-spring", Role::Plugin), 1);
    assert_eq!(complaints("flotor-wall", Role::Plugin, "flotor-wall-emulator", Role::Emulator), 1);
    assert_eq!(complaints("flotor-wall-emulator", Role::Emulator, "flotor-wall", Role::Plugin), 0);
    assert_eq!(complaints("flotor-wall-emulator", Role::Emulator, "flotor-spring", Role::Plugin), 1);
    assert_eq!(complaints("flotor-wall-emulator", Role::Emulator, "flotor-simulated", Role::Plugin), 0);
}

/// Crates a plugin is made of that belong to hosts and programs. The lines are those of [`made_of`].
fn carried_by_mistake(plugin: &str, made_of: &str) -> Vec<String> {
    let is_wrong = |line: &&str| {
        let (name, _) = line.split_once(' ').unwrap_or((line, ""));
        ["clap", "flotor_loader"].contains(&name)
    };
    made_of.lines().filter(is_wrong).map(|line| format!("{plugin} carries {line}")).collect()
}

/// What cargo builds this crate of when nothing else is built: a line a crate, its name and its features. `cargo metadata`
/// merges the features of the whole workspace.
fn made_of(name: &str) -> String {
    let mut cargo = process::Command::new(env!("CARGO"));
    cargo.args("tree --offline --edges normal --prefix none -p".split(' '));
    cargo.args([name, "--format", "{lib} {f}"]).current_dir(workspace_root());
    let output = cargo.output().expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("names are text")
}

#[test]
fn plugins_carry_neither_loader_nor_command_line() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let plugins = workspace_members(&metadata()).into_iter();
    for plugin in plugins.filter(|member| matches!(member.role, Role::Plugin | Role::Fixture)) {
        let made_of = made_of(&plugin.name);
        assert!(made_of.lines().any(|line| line.starts_with("flotor_hal ")), "{made_of}");
        assert_eq!(carried_by_mistake(&plugin.name, &made_of), Vec::<String>::new());
    }
}

#[test]
fn a_plugin_that_carries_the_loader_is_noticed() {
    let carried = |made_of| carried_by_mistake("flotor-wall", made_of).len();
    assert_eq!(carried("flotor_wall default\nflotor_hal default,instructions\nglam f64,std"), 0);
    assert_eq!(carried("flotor_wall default\nflotor_hal default\nflotor_loader \nglam f64,std"), 1);
    assert_eq!(carried("flotor_wall default\nflotor_hal \nclap std"), 1);
    // With features by default, as cargo resolves them: an emulator has every right to both.
    let emulator = carried_by_mistake("flotor-maglev-emulator", &made_of("flotor-maglev-emulator"));
    assert!(
        ["clap", "flotor_loader"].iter().all(|name| emulator.iter().any(|line| line.contains(name))),
        "{emulator:?}"
    );
}

// ---------------------------------------------------------------- code, as tokens

/// All identifiers of a source text: code only, no comments, no text in quotes.
fn identifiers(source: &str) -> Vec<String> {
    fn collect(tokens: TokenStream, found: &mut Vec<String>) {
        for token in tokens {
            match token {
                TokenTree::Ident(identifier) => found.push(identifier.to_string()),
                TokenTree::Group(group) => collect(group.stream(), found),
                TokenTree::Punct(_) | TokenTree::Literal(_) => {}
            }
        }
    }
    let mut found = Vec::new();
    let tokens: TokenStream = source.parse().expect("the compiler reads this file, so it is made of tokens");
    collect(tokens, &mut found);
    found
}

fn identifiers_of(file: &Path) -> Vec<String> {
    identifiers(&std::fs::read_to_string(workspace_root().join(file)).expect("a source file is text"))
}

#[test]
fn comments_and_text_are_not_code() {
    let harmless = "//! unsafe\n/* unsafe */ /// unsafe\nfn f<'a>() -> &'a str { r#\"unsafe \" unsafe\"# }";
    assert!(!identifiers(harmless).contains(&"unsafe".to_owned()));
    assert!(identifiers("macro_rules! m { () => { unsafe { f() } } }").contains(&"unsafe".to_owned()));
    assert!(identifiers("#[unsafe(no_mangle)] fn f() {}").contains(&"unsafe".to_owned()));
}

#[test]
fn the_host_names_no_plugin() {
    let members = workspace_members(&metadata());
    let plugins = members.iter().filter(|member| member.role == Role::Plugin);
    let plugins: Vec<String> = plugins.map(|member| member.name.replace('-', "_")).collect();
    let rooms = ["host", "interop", "lab", "study"].into_iter();
    let sources = rooms.flat_map(|room| files_under(room, "rs").expect("it has sources"));
    let sources: Vec<_> = sources.collect();
    assert!(sources.len() > 10, "{} sources of the host", sources.len());
    for file in sources.iter().filter(|file| !file.display().to_string().contains("/examples/")) {
        let named = identifiers_of(file).into_iter().find(|identifier| plugins.contains(identifier));
        assert_eq!(named, None, "{} names a plugin's crate: load it instead", file.display());
    }
}

// ---------------------------------------------------------------- unsafe

/// Where `unsafe` may stand, and why it has to. A folder ends in a slash. Whoever adds a line says why no safe
/// way exists; a line whose file no longer needs it fails the test, too.
const UNSAFE: &[(&str, &str)] = &[
    ("hal/src/abi/", "the binary contract: function tables across shared libraries, and the export macros"),
    ("hal/src/extension/", "the function tables of the extensions"),
    ("hal/loader/src/", "opens plugin files and calls their tables: the host's side of the binary contract"),
    ("hal/loader/examples/load_model.rs", "a host of fifty lines loads the plugin file that its user names"),
    (
        "host/session/src/registry/mod.rs",
        "the one place of the host that loads a plugin file, which the user guarantees",
    ),
    (
        "host/servo/src/platform/linux/process_group.rs",
        "what a child does between `fork` and `exec`: it asks for its end with its parent, and starts the guard of its group",
    ),
    (
        "interop/compat/",
        "entry points in C for programs of other makers' interfaces, and what a library in another program hooks: `fork`, `exit`",
    ),
    (
        "lab/guard/src/lib.rs",
        "an allocator in the place of the C library's, for the one process in which `validate` looks for overruns",
    ),
    ("viewer/src/shape.rs", "the one place of the viewer that loads a plugin file"),
    (
        "devices/maglev/emulator/src/bin/flotor-maglev-emulator/plant.rs",
        "the emulator loads the plugin that is its plant",
    ),
    (
        "devices/maglev/src/transport/usb/queue.rs",
        "USB transfers that wait on the bus while the loop runs: rusb wraps only those that block",
    ),
    (
        "devices/vendor-sdk/src/library.rs",
        "opens the library of a vendor's SDK that the user has installed, and looks up its functions by name",
    ),
    (
        "devices/vendor-sdk/src/platform/",
        "opens a library; the signal mask of a thread: threads that an SDK starts take it over, and signals belong to the host",
    ),
    ("devices/force-dimension/src/ffi.rs", "calls into the user's DHD, which is C"),
    (
        "devices/openhaptics/src/ffi.rs",
        "calls into the user's HDAPI, which is C, and the callback of its scheduler",
    ),
    (
        "interop/python/src/rows.rs",
        "NumPy records that are the contract's structs: the layout promise, and arrays used where they lie",
    ),
    (
        "host/command/src/platform/unix/supervision.rs",
        "a copy of the process, a word that both share, and signals with their sender",
    ),
    ("host/command/src/platform/windows.rs", "modes of the console, and the function that it calls"),
    (
        "host/servo/src/platform/linux/last_stop.rs",
        "handlers of deadly signals on a stack of their own, a hook in `exit`, signals that are waited for",
    ),
    (
        "host/servo/src/platform/linux/shared_memory.rs",
        "memory that a model in a process of its own shares with the loop: a mapping",
    ),
    (
        "host/servo/src/platform/windows/last_stop.rs",
        "a filter for exceptions that nobody handles, and a callback at the end of the process",
    ),
    ("host/servo/src/platform/windows/scheduling.rs", "priority and cores of the calling thread"),
    (
        "host/session/src/platform/linux/locale.rs",
        "the locale of the C library, which plugins change: no safe crate has it",
    ),
    ("study/program/src/platform/windows.rs", "how much of a disk is free"),
    ("viewer/src/platform/windows.rs", "times and memory of the process"),
    ("tests/tests/realtime.rs", "an allocator that counts, to see that a tick does not allocate"),
];

/// Files that may not hold `unsafe` and do, then entries of the list that nothing needs.
fn unsafe_complaints(files_with_unsafe: &[String], allowed: &[(&str, &str)]) -> Vec<String> {
    let covers =
        |entry: &str, file: &str| if entry.ends_with('/') { file.starts_with(entry) } else { file == entry };
    let unlisted = files_with_unsafe
        .iter()
        .filter(|file| !allowed.iter().any(|(entry, _)| covers(entry, file)))
        .map(|file| format!("{file} holds `unsafe` and is not listed in tests/tests/system/architecture.rs"));
    let unneeded =
        allowed.iter().filter(|(entry, _)| !files_with_unsafe.iter().any(|file| covers(entry, file))).map(
            |(entry, _)| format!("tests/tests/system/architecture.rs lists {entry}, which holds no `unsafe`"),
        );
    unlisted.chain(unneeded).collect()
}

#[test]
fn unsafe_code_stands_only_where_it_is_listed() {
    let sources = files_under("", "rs").expect("the workspace can be read");
    let with_unsafe = sources.iter().filter(|file| identifiers_of(file).iter().any(|word| word == "unsafe"));
    let with_unsafe: Vec<String> = with_unsafe.map(|file| file.display().to_string()).collect();
    assert_eq!(unsafe_complaints(&with_unsafe, UNSAFE), Vec::<String>::new());
}

#[test]
fn unlisted_unsafe_and_stale_entries_are_noticed() {
    let files = ["hal/src/abi/text.rs".to_owned(), "host/servo/src/servo.rs".to_owned()];
    let complaints =
        unsafe_complaints(&files, &[("hal/src/abi/", "contract"), ("tests/alloc.rs", "allocator")]);
    assert_eq!(complaints.len(), 2);
    assert!(complaints[0].starts_with("host/servo/src/servo.rs"));
    assert!(complaints[1].contains("tests/alloc.rs"));
}

// ---------------------------------------------------------------- one system

/// What `cfg` asks for to know the system.
const SYSTEM_CONDITIONS: &[&str] =
    &["unix", "windows", "target_os", "target_family", "target_env", "target_vendor"];

/// Where a system may be asked for outside a module `platform`: emulators plug a device into the kernel of Linux, and the export
/// macro asks in the crate of a plugin, which has no such module.
const ASKED_ELSEWHERE: &[&str] =
    &["devices/falcon/emulator/", "devices/maglev/emulator/", "devices/usbip/", "hal/src/abi/metadata.rs"];

/// Crates that run on more than one system: what only one of them has is named in their modules `platform` alone. Tests and
/// examples ask for nothing of a system, but some need its programs.
const PORTED: &[&str] = &[
    "devices/falcon/src/",
    "devices/force-dimension/src/",
    "devices/force-sensor/src/",
    "devices/force-switch/src/",
    "devices/haply/src/",
    "devices/inverse3/src/",
    "devices/maglev/src/",
    "devices/openhaptics/src/",
    "devices/serial/src/",
    "devices/simulated/src/",
    "devices/spacemouse/src/",
    "devices/vendor-sdk/src/",
    "hal/src/",
    "hal/loader/src/",
    "lab/calibration/src/",
    "host/command/src/",
    "host/contact/src/",
    "host/core/src/",
    "host/coupling/src/",
    "lab/identify/src/",
    "lab/judge/src/",
    "lab/measure/src/",
    "host/live/src/",
    "host/plot/src/",
    "host/record/src/",
    "lab/scene-test/src/",
    "host/servo/src/",
    "host/session/src/",
    "host/src/",
    "study/statistics/src/",
    "study/analysis/src/",
    "study/program/src/",
    "study/core/src/",
    "study/design/src/",
    "host/sync/src/",
    "models/",
    "viewer/drawing/src/",
    "viewer/history/src/",
    "viewer/src/",
];

/// Where files of Linux's kernel are named outside a module `platform`, in crates that run on no other system yet: libraries that
/// stand in for those of other makers, and what starts a program with them.
const KERNEL_FILES_ELSEWHERE: &[&str] =
    &["interop/compat/common/src/process.rs", "interop/lend/src/guard.rs"];

/// Crates with what only one system has.
const SYSTEM_CRATES: &[&str] = &["libc", "rustix", "signal_hook", "thread_priority", "windows_sys"];

/// Whether a file is, or is below, a module `platform`.
fn is_of_a_platform(file: &str) -> bool {
    file.contains("/platform/") || file.ends_with("/platform.rs")
}

/// The system that a source asks for by `cfg`, if it does.
fn system_conditions(tokens: TokenStream) -> Vec<String> {
    let (mut found, mut is_cfg) = (Vec::new(), false);
    for token in tokens {
        match token {
            TokenTree::Ident(name) => is_cfg = ["cfg", "cfg_attr"].contains(&name.to_string().as_str()),
            TokenTree::Punct(mark) if mark.as_char() == '!' => {} // `cfg!(…)`
            TokenTree::Group(group) if is_cfg => {
                let asked = identifiers(&group.stream().to_string());
                found.extend(asked.into_iter().filter(|name| SYSTEM_CONDITIONS.contains(&name.as_str())));
                is_cfg = false;
            }
            TokenTree::Group(group) => found.extend(system_conditions(group.stream())),
            TokenTree::Punct(_) | TokenTree::Literal(_) => is_cfg = false,
        }
    }
    found
}

/// What of one system a source names: `std::os`, or a crate of that system.
fn system_names(source: &str) -> Vec<String> {
    let names = identifiers(source);
    let is_std_os = |pair: &[String]| pair == ["std", "os"];
    let mut found: Vec<String> =
        names.windows(2).filter(|pair| is_std_os(pair)).map(|pair| pair.join("::")).collect();
    found.extend(names.into_iter().filter(|name| SYSTEM_CRATES.contains(&name.as_str())));
    found
}

/// Names of files of Linux's kernel, in texts of a source.
fn kernel_files(tokens: TokenStream) -> Vec<String> {
    let mut found = Vec::new();
    for token in tokens {
        match token {
            TokenTree::Group(group) => found.extend(kernel_files(group.stream())),
            TokenTree::Literal(literal) => {
                let text = literal.to_string();
                let of_kernel = |folder: &str| {
                    let rest = text.trim_start_matches(['b', 'c', 'r', '#']).strip_prefix(folder);
                    rest.is_some_and(|rest| rest.starts_with(['/', '"']))
                };
                found.extend(["\"/proc", "\"/sys"].into_iter().any(of_kernel).then(|| text.clone()));
            }
            TokenTree::Ident(_) | TokenTree::Punct(_) => {}
        }
    }
    found
}

/// Whether a file is a test of its own, which may ask the system that it runs on.
fn is_a_test(file: &str) -> bool {
    file.starts_with("tests/") || file.contains("/tests/")
}

/// What a source has that belongs into a module `platform`.
fn outside_its_platform(file: &str, source: &str) -> Vec<String> {
    let begins = |folders: &[&str]| folders.iter().any(|folder| file.starts_with(folder));
    if is_of_a_platform(file) || begins(ASKED_ELSEWHERE) {
        return Vec::new();
    }
    let tokens: TokenStream = source.parse().expect("the compiler reads it, so it is made of tokens");
    let mut found = system_conditions(tokens.clone());
    if !is_a_test(file) && !begins(KERNEL_FILES_ELSEWHERE) {
        found.extend(kernel_files(tokens));
    }
    if begins(PORTED) {
        found.extend(system_names(source));
    }
    found
}

#[test]
fn what_differs_between_systems_stands_in_modules_of_the_platform() {
    let mut complaints = Vec::new();
    for file in files_under("", "rs").expect("the workspace can be read") {
        let source = std::fs::read_to_string(workspace_root().join(&file)).expect("a source file is text");
        let name = file.display().to_string();
        let found = outside_its_platform(&name, &source);
        if !found.is_empty() {
            complaints.push(format!("{name} has {found:?}: move it into a module `platform` of its crate"));
        }
    }
    assert_eq!(complaints, Vec::<String>::new());
}

#[test]
fn a_system_outside_its_platform_is_noticed() {
    let count = |file: &str, source: &str| outside_its_platform(file, source).len();
    let asks = "#[cfg(all(test, unix))] mod tests { fn f() { if cfg!(target_os = \"linux\") {} } }";
    assert_eq!(count("viewer/src/main.rs", asks), 2);
    assert_eq!(count("host/src/platform/mod.rs", asks), 0);
    assert_eq!(count("devices/usbip/src/lib.rs", asks), 0);
    let names = "use std::os::fd::AsFd; use rustix::io; fn f() { std::process::id() }";
    assert_eq!(
        (count("host/live/src/client.rs", names), count("interop/compat/common/src/lib.rs", names)),
        (2, 0)
    );
    let kernel = "fn f(n: u32) { read(\"/proc/version\"); read(format!(\"/sys/{n}\")); read(\"/processes\"); Path::new(\"/proc\") }";
    assert_eq!((count("lab/judge/src/watch.rs", kernel), count("viewer/tests/memory.rs", kernel)), (3, 0));
    assert_eq!(
        (count("interop/compat/common/src/process.rs", kernel), count("devices/usbip/src/vhci.rs", kernel)),
        (0, 0)
    );
    // Neither text nor other conditions.
    let harmless = "#[cfg(test)] mod tests { const A: &str = \"cfg(unix)\"; fn windows() { slice.windows(2) } } // cfg(unix)";
    assert_eq!(count("host/live/src/client.rs", harmless), 0);
}

// ---------------------------------------------------------------- the same bits everywhere

/// Methods of floating-point numbers whose last bit the system's library or the compiler chooses, or that are slow where the
/// processor has no instruction for them.
const UNPORTABLE: &[&str] = &[
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "exp", "exp2",
    "exp_m1", "hypot", "ln", "ln_1p", "log", "log10", "log2", "mul_add", "powf", "powi", "sin", "sin_cos",
    "sinh", "tan", "tanh",
];

/// Parts of paths whose numbers nobody compares bit by bit: pictures and tests.
const UNCOMPARED: &[&str] = &["viewer/", "plot/", "tests/", "tests.rs", "benches/", "examples/", "fuzz/"];

/// Calls of such methods, and mentions of them as functions of a type, outside the tests of the file.
fn unportable(tokens: TokenStream) -> Vec<String> {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let text = |place: Option<usize>| {
        place.and_then(|at| tokens.get(at)).map(ToString::to_string).unwrap_or_default()
    };
    let mut found = Vec::new();
    for (at, token) in tokens.iter().enumerate() {
        let before = |steps: usize| text(at.checked_sub(steps));
        match token {
            TokenTree::Group(_) if before(2) == "mod" && before(3).replace(' ', "") == "[cfg(test)]" => {}
            TokenTree::Group(group) => found.extend(unportable(group.stream())),
            TokenTree::Ident(name) if UNPORTABLE.contains(&name.to_string().as_str()) => {
                let is_call = before(1) == "." && text(Some(at + 1)).starts_with('(');
                if is_call || ["f64", "f32"].contains(&before(3).as_str()) {
                    found.push(name.to_string());
                }
            }
            _ => {}
        }
    }
    found
}

#[test]
fn numbers_that_count_come_from_portable_functions() {
    let sources = files_under("", "rs").expect("the workspace can be read");
    let is_compared = |file: &Path| !UNCOMPARED.iter().any(|part| file.display().to_string().contains(part));
    let complaint = |file: &Path| {
        let source = std::fs::read_to_string(workspace_root().join(file)).expect("a source file is text");
        let found = unportable(source.parse().expect("the compiler reads it, so it is made of tokens"));
        let name = file.display();
        (!found.is_empty())
            .then(|| format!("{name} uses {found:?} of `f64`: take those of `flotor_hal::math`"))
    };
    let compared = sources.iter().filter(|file| is_compared(file));
    assert_eq!(compared.filter_map(|file| complaint(file)).collect::<Vec<_>>(), Vec::<String>::new());
}

#[test]
fn an_unportable_function_is_noticed() {
    let offends = |source: &str| unportable(source.parse().expect("these are tokens")).len();
    assert_eq!(offends("fn f() { g(x.sin(), y.map(f64::tanh)) }"), 2);
    assert_eq!(
        offends(
            "fn f() { math::sin(x) + angle.sin + x.sqrt() } #[cfg(test)] mod tests { fn f() { x.sin() } }"
        ),
        0
    );
}

// ---------------------------------------------------------------- manifests

/// Dependencies of `[workspace.dependencies]` that nobody gives a reason for: in a comment at the end of the
/// line, or in the lines just above. Crates of the workspace itself need none.
fn dependencies_without_reason(manifest: &str) -> Vec<&str> {
    let lines = manifest.lines().skip_while(|line| *line != "[workspace.dependencies]").skip(1);
    let mut explained_above = false;
    let mut unexplained = Vec::new();
    for line in lines.take_while(|line| !line.starts_with('[')) {
        let line = line.trim();
        // A headline groups lines, it gives no reason.
        if let Some(comment) = line.strip_prefix('#') {
            explained_above |= !comment.trim_start().starts_with("--");
            continue;
        }
        if let Some((name, rest)) = line.split_once('=') {
            let own = rest.contains("path =");
            let explained =
                explained_above || rest.rsplit_once('#').is_some_and(|(_, reason)| reason.len() > 5);
            unexplained.extend((!own && !explained).then(|| name.trim()));
        }
        explained_above = false;
    }
    unexplained
}

#[test]
fn every_dependency_has_a_reason() {
    let manifest = std::fs::read_to_string(workspace_root().join("Cargo.toml")).expect("there is a manifest");
    assert!(manifest.contains("[workspace.dependencies]"));
    assert_eq!(dependencies_without_reason(&manifest), Vec::<&str>::new());
}

#[test]
fn a_dependency_without_reason_is_noticed() {
    let manifest = "[workspace.dependencies]\n# -- tests\na = \"1\"\n# Reads poses.\nb = \"1\"\nc = \"2\"\n\
                    d = \"3\" # draws pictures\ne = { path = \"e\" }\n[profile.dev]\nopt-level = 1\n";
    assert_eq!(dependencies_without_reason(manifest), ["a", "c"]);
}

#[test]
fn every_crate_takes_the_lints_of_the_workspace() {
    for member in metadata().workspace_packages() {
        let manifest = std::fs::read_to_string(&member.manifest_path).expect("a manifest is text");
        assert!(manifest.contains("[lints]\nworkspace = true"), "{} has lints of its own", member.name);
    }
}
