//! The public interface of `flotor-hal` and `flotor-loader` is the committed one, and a break of it comes with a version that says so.
//!
//! `data/public_api.txt` has a line for each public item, feature and the oldest Rust. What an author of a plugin cannot avoid stands
//! in one line: a trait with the items it requires, a struct that can be built with its fields, an enum that can be matched with its
//! variants. So a line that goes is a break, and a line that comes is an addition. Items that a macro makes are not seen.
//!
//! After a change: `FLOTOR_WRITE_API=1 cargo test -p flotor-tests --features formats public_api`. Once a version is released, that is
//! once the changelog has its heading, the file is not written before the version in the root `Cargo.toml` allows the change.

use flotor_tests::workspace_root;
use quote::ToTokens;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use syn::{
    Attribute, Fields, ImplItem, Item, ItemImpl, ItemMacro, ItemTrait, TraitItem, UseTree, Visibility,
};

const FILE: &str = "tests/data/public_api.txt";

// ---------------------------------------------------------------- public items, a line each

/// The lines of one crate.
#[derive(Default)]
struct Reader {
    lines: BTreeSet<String>,
    /// Types whose methods are public.
    types: BTreeSet<String>,
    /// Blocks that count if their type is public, with their module and condition.
    impls: Vec<(String, String, ItemImpl)>,
}

/// The items of one module: where they are public, under which condition, and where its files lie.
#[derive(Clone)]
struct Module {
    path: String,
    condition: String,
    folder: PathBuf,
}

impl Reader {
    /// All public items of a source file and of the modules that it names.
    fn of_crate(name: &str, file: &Path) -> BTreeSet<String> {
        let folder = file.parent().unwrap_or(Path::new("")).to_owned();
        let mut reader = Self::default();
        reader.module(&text(file), &Module { path: name.to_owned(), condition: String::new(), folder });
        reader.finish()
    }

    fn finish(mut self) -> BTreeSet<String> {
        for (path, condition, block) in std::mem::take(&mut self.impls) {
            self.take_impl(&path, &condition, &block);
        }
        self.lines
    }

    fn module(&mut self, source: &str, module: &Module) {
        let file = syn::parse_file(source).expect("the compiler reads this file");
        self.items(&file.items, module);
    }

    fn items(&mut self, items: &[Item], module: &Module) {
        let private: Vec<String> = items
            .iter()
            .filter_map(|item| match item {
                Item::Mod(item) if !is_public(&item.vis) => Some(item.ident.to_string()),
                _ => None,
            })
            .collect();
        for item in items {
            self.item(item, module, &private);
        }
    }

    fn item(&mut self, item: &Item, module: &Module, private: &[String]) {
        let Some(condition) = condition(attributes(item), &module.condition) else { return };
        let path = &module.path;
        let mut add = |what: String| self.lines.insert(compact(&format!("{what}{condition}")));
        match item {
            Item::Const(item) if is_public(&item.vis) => {
                add(format!("const {path}::{}: {}", item.ident, shown(&item.ty)));
            }
            Item::Static(item) if is_public(&item.vis) => {
                add(format!("static {path}::{}: {}", item.ident, shown(&item.ty)));
            }
            Item::Type(item) if is_public(&item.vis) => {
                add(format!("type {path}::{}{} = {}", item.ident, shown(&item.generics), shown(&item.ty)));
            }
            Item::Fn(item) if is_public(&item.vis) => {
                add(format!("{path}::{}", shown(&item.sig)));
            }
            Item::Macro(item) => self.take_macro(item, &condition),
            Item::Struct(item) if is_public(&item.vis) => {
                let name = format!("{path}::{}", item.ident);
                let fields: Vec<String> = fields(&item.fields).collect();
                let is_built = fields.len() == item.fields.len() && !is_open(&item.attrs);
                let head = format!("struct {name}{}", shown(&item.generics));
                add(if is_built { format!("{head} {{ {} }}", fields.join(", ")) } else { head });
                for field in fields.iter().filter(|_| !is_built) {
                    add(format!("field {name}.{field}"));
                }
                self.public_type(&name, &item.ident, &item.attrs, &condition);
            }
            Item::Enum(item) if is_public(&item.vis) => {
                let name = format!("{path}::{}", item.ident);
                let variants = item.variants.iter().map(|variant| {
                    // Its fields are as public as it is; documentation is no interface.
                    let bare =
                        variant.fields.iter().map(|field| shown(&field.ty)).collect::<Vec<_>>().join(", ");
                    let value = variant
                        .discriminant
                        .as_ref()
                        .map_or(String::new(), |(_, value)| format!(" = {}", shown(value)));
                    format!("{}({bare}){value}", variant.ident).replace("()", "")
                });
                let (variants, is_open) = (variants.collect::<Vec<_>>(), is_open(&item.attrs));
                let head = format!("enum {name}{}", shown(&item.generics));
                add(if is_open { head } else { format!("{head} {{ {} }}", variants.join(", ")) });
                for variant in variants.iter().filter(|_| is_open) {
                    add(format!("variant {name}::{variant}"));
                }
                self.public_type(&name, &item.ident, &item.attrs, &condition);
            }
            Item::Trait(item) if is_public(&item.vis) => self.take_trait(item, path, &condition),
            Item::Use(item) if is_public(&item.vis) => {
                let mut names = Vec::new();
                flatten(&item.tree, "", &mut names);
                // What comes out of a private module is listed where it is defined.
                let own =
                    |name: &&String| private.iter().any(|module| name.starts_with(&format!("{module}::")));
                names.iter().filter(|name| !own(name)).for_each(|name| {
                    add(format!("use {path}: {name}"));
                });
            }
            Item::Impl(block) => self.impls.push((path.clone(), condition, block.clone())),
            Item::Mod(item) => {
                let name = item.ident.to_string();
                let path = if is_public(&item.vis) { format!("{path}::{name}") } else { path.clone() };
                let inside = Module { path, condition, folder: module.folder.join(&name) };
                match &item.content {
                    Some((_, items)) => self.items(items, &inside),
                    None => self.module(&text(&file_of(&module.folder, &name)), &inside),
                }
            }
            _ => {}
        }
    }

    /// A type: its name, and what it derives.
    fn public_type(&mut self, name: &str, ident: &syn::Ident, attributes: &[Attribute], condition: &str) {
        self.types.insert(ident.to_string());
        for attribute in attributes {
            if attribute.path().is_ident("repr") {
                self.lines.insert(compact(&format!("{} {name}", shown(&attribute.meta))));
            }
            if !attribute.path().is_ident("derive") {
                continue;
            }
            let _ = attribute.parse_nested_meta(|derived| {
                self.lines.insert(compact(&format!("impl {} for {name}{condition}", shown(&derived.path))));
                Ok(())
            });
        }
    }

    fn take_trait(&mut self, item: &ItemTrait, path: &str, condition: &str) {
        let name = format!("{path}::{}", item.ident);
        let mut required = Vec::new();
        for inside in &item.items {
            let (text, is_provided) = match inside {
                TraitItem::Fn(function) => (shown(&function.sig), function.default.is_some()),
                TraitItem::Const(constant) => {
                    (format!("const {}: {}", constant.ident, shown(&constant.ty)), constant.default.is_some())
                }
                TraitItem::Type(kind) => (format!("type {}: {}", kind.ident, shown(&kind.bounds)), false),
                _ => continue,
            };
            if is_provided {
                self.lines.insert(compact(&format!("provided {name}: {text}{condition}")));
            } else {
                required.push(text);
            }
        }
        let (of, above) = (shown(&item.generics), shown(&item.supertraits));
        self.lines
            .insert(compact(&format!("trait {name}{of}: {above} {{ {} }}{condition}", required.join("; "))));
        self.types.insert(item.ident.to_string());
    }

    fn take_impl(&mut self, path: &str, condition: &str, block: &ItemImpl) {
        let of = shown(&block.self_ty);
        let head = of.split(['<', ' ']).next().unwrap_or_default();
        if !self.types.contains(head) {
            return;
        }
        if let Some((_, interface, _)) = &block.trait_ {
            let generics = shown(&block.generics);
            self.lines
                .insert(compact(&format!("impl{generics} {} for {path}::{of}{condition}", shown(interface))));
            return;
        }
        for inside in &block.items {
            let (attributes, visibility, text) = match inside {
                ImplItem::Fn(function) => (&function.attrs, &function.vis, shown(&function.sig)),
                ImplItem::Const(constant) => (
                    &constant.attrs,
                    &constant.vis,
                    format!("const {}: {}", constant.ident, shown(&constant.ty)),
                ),
                _ => continue,
            };
            if let Some(condition) = self::condition(attributes, condition).filter(|_| is_public(visibility))
            {
                self.lines.insert(compact(&format!("{path}::{of}: {text}{condition}")));
            }
        }
    }

    /// A macro for authors: the patterns that it takes.
    fn take_macro(&mut self, item: &ItemMacro, condition: &str) {
        let Some(name) = &item.ident else { return };
        if !item.attrs.iter().any(|attribute| attribute.path().is_ident("macro_export")) {
            return;
        }
        // Of `(pattern) => { code };` every first group.
        let groups = item
            .mac
            .tokens
            .clone()
            .into_iter()
            .filter(|token| matches!(token, proc_macro2::TokenTree::Group(_)));
        for pattern in groups.step_by(2) {
            self.lines.insert(compact(&format!("macro {name}! {pattern}{condition}")));
        }
    }
}

/// The fields that others may name, with their types.
fn fields(fields: &Fields) -> impl Iterator<Item = String> + '_ {
    fields.iter().enumerate().filter(|(_, field)| is_public(&field.vis)).map(|(index, field)| {
        let name = field.ident.as_ref().map_or(index.to_string(), ToString::to_string);
        format!("{name}: {}", shown(&field.ty))
    })
}

fn flatten(tree: &UseTree, before: &str, names: &mut Vec<String>) {
    match tree {
        UseTree::Path(path) => flatten(&path.tree, &format!("{before}{}::", path.ident), names),
        UseTree::Name(name) => names.push(format!("{before}{}", name.ident)),
        UseTree::Rename(name) => names.push(format!("{before}{} as {}", name.ident, name.rename)),
        UseTree::Glob(_) => names.push(format!("{before}*")),
        UseTree::Group(group) => group.items.iter().for_each(|tree| flatten(tree, before, names)),
    }
}

fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(item) => &item.attrs,
        Item::Enum(item) => &item.attrs,
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Macro(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Static(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        Item::Type(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        _ => &[],
    }
}

/// The features an item needs, after those it is inside of; `None` for a test.
fn condition(attributes: &[Attribute], outside: &str) -> Option<String> {
    let own = attributes.iter().filter(|attribute| attribute.path().is_ident("cfg"));
    own.map(|attribute| attribute.meta.require_list().map_or(String::new(), |list| list.tokens.to_string()))
        .try_fold(outside.to_owned(), |all, one| (one != "test").then(|| format!("{all} if {one}")))
}

/// Whether more fields or variants may come.
fn is_open(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| attribute.path().is_ident("non_exhaustive"))
}

fn is_public(visibility: &Visibility) -> bool {
    matches!(visibility, Visibility::Public(_))
}

fn file_of(folder: &Path, name: &str) -> PathBuf {
    let file = folder.join(format!("{name}.rs"));
    if file.is_file() { file } else { folder.join(name).join("mod.rs") }
}

fn shown(tokens: &impl ToTokens) -> String {
    tokens.to_token_stream().to_string()
}

/// One line, spaced as people write it.
fn compact(text: &str) -> String {
    let mut text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    for (from, to) in [
        (" :: ", "::"),
        (":: ", "::"),
        (" ::", "::"),
        (" ,", ","),
        (" ;", ";"),
        (" :", ":"),
        (" (", "("),
        ("( ", "("),
        (" )", ")"),
        ("& ", "&"),
        (" <", "<"),
        ("< ", "<"),
        (" >", ">"),
        ("[ ", "["),
        (" ]", "]"),
        ("* mut", "*mut"),
        ("* const", "*const"),
        ("' ", "'"),
        (": {", " {"),
        ("{ }", "{}"),
        ("->(", "-> ("),
        (" ->", " ->"),
        ("):->", ") ->"),
    ] {
        text = text.replace(from, to);
    }
    text.trim_end().to_owned()
}

fn text(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()))
}

// ---------------------------------------------------------------- versions

/// `flotor-hal VERSION` and a line for each item.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Api {
    version: [u32; 3],
    lines: BTreeSet<String>,
}

impl Api {
    fn of_sources() -> Self {
        let root = workspace_root();
        let manifest =
            |path: &str| text(&root.join(path)).parse::<toml::Table>().expect("a manifest is TOML");
        let (workspace, hal) = (manifest("Cargo.toml"), manifest("hal/Cargo.toml"));
        let mut lines = Reader::of_crate("flotor_hal", &root.join("hal/src/lib.rs"));
        lines.extend(Reader::of_crate("flotor_loader", &root.join("hal/loader/src/lib.rs")));
        let features = hal["features"].as_table().expect("the contract has features");
        lines.extend(features.keys().map(|feature| format!("feature {feature}")));
        lines
            .insert(format!("rust-version {}", hal["package"]["rust-version"].as_str().expect("it has one")));
        let version = workspace["workspace"]["package"]["version"].as_str().expect("it has one");
        Self { version: parsed(version), lines }
    }

    fn of_file(text: &str) -> Self {
        let mut lines = text.lines();
        let version = lines.next().and_then(|line| line.strip_prefix("flotor-hal ")).unwrap_or("0.0.0");
        Self { version: parsed(version), lines: lines.map(str::to_owned).collect() }
    }

    fn to_text(&self) -> String {
        let [major, minor, patch] = self.version;
        let head = format!("flotor-hal {major}.{minor}.{patch}\n");
        self.lines.iter().fold(head, |text, line| text + line + "\n")
    }

    /// The lines that go and come, for people.
    fn changes_to(&self, new: &Self) -> String {
        let mut text = String::new();
        for line in self.lines.difference(&new.lines) {
            writeln!(text, "- {line}").expect("text grows");
        }
        for line in new.lines.difference(&self.lines) {
            writeln!(text, "+ {line}").expect("text grows");
        }
        text
    }

    /// Why this version cannot be followed by the other one: Semantic Versioning, where `is_released` says that others have it.
    fn refuses(&self, new: &Self, is_released: bool) -> Option<String> {
        let ([major, minor, patch], is_addition) = (self.version, self.lines.is_subset(&new.lines));
        let least = match (major, is_addition) {
            _ if !is_released || self.lines == new.lines => return None,
            (_, true) => [major, minor, patch + 1],
            (0, false) => [0, minor + 1, 0],
            (_, false) => [major + 1, 0, 0],
        };
        let kind = if is_addition { "an addition" } else { "a break" };
        let wanted = least.map(|number| number.to_string()).join(".");
        (new.version < least).then(|| {
            format!("{kind} needs version {wanted} in the root Cargo.toml:\n{}", self.changes_to(new))
        })
    }
}

fn parsed(version: &str) -> [u32; 3] {
    let mut numbers = version.split('.').map(|number| number.parse().expect("a version is three numbers"));
    std::array::from_fn(|_| numbers.next().expect("a version is three numbers"))
}

fn is_released(changelog: &str, [major, minor, patch]: [u32; 3]) -> bool {
    changelog.lines().any(|line| line.starts_with(&format!("## [{major}.{minor}.{patch}]")))
}

// ---------------------------------------------------------------- tests

#[test]
fn the_public_interface_is_the_committed_one() {
    let (path, new) = (workspace_root().join(FILE), Api::of_sources());
    let old = Api::of_file(&std::fs::read_to_string(&path).unwrap_or_default());
    let refused = old.refuses(&new, is_released(&text(&workspace_root().join("CHANGELOG.md")), old.version));
    assert_eq!(refused, None);
    if std::env::var_os("FLOTOR_WRITE_API").is_some() {
        std::fs::write(&path, new.to_text()).expect("the file can be written");
        return;
    }
    assert!(
        old == new,
        "the public interface of flotor-hal or flotor-loader has changed: CHANGELOG.md says how, under ABI, and\n\
         FLOTOR_WRITE_API=1 cargo test -p flotor-tests --features formats public_api\n{}",
        old.changes_to(&new)
    );
}

/// The lines of a made-up crate.
fn lines(source: &str) -> BTreeSet<String> {
    let mut reader = Reader::default();
    reader.module(source, &Module { path: "c".to_owned(), condition: String::new(), folder: PathBuf::new() });
    reader.finish()
}

const CRATE: &str = "pub struct Built { pub a: f64 } #[derive(Clone)] pub struct Closed { pub a: f64, b: u8 } \
    impl Closed { pub const fn a(&self) -> f64 { self.a } fn b(&self) {} } \
    pub enum E { A, B } #[non_exhaustive] pub enum Open { A } pub(crate) struct Own; impl Own { pub fn f() {} } \
    pub trait T { const C: f64; fn required(&self); fn provided(&self) {} } \
    mod inner { pub fn f<X: Copy>(x: &[X]) -> u8 { 0 } } pub use inner::f; #[cfg(test)] mod tests { pub fn t() {} } \
    #[cfg(feature = \"more\")] pub mod more { pub const N: u32 = 1; }";

#[test]
fn what_breaks_an_author_is_a_line_that_goes() {
    let before = lines(CRATE);
    assert!(before.contains("c::fn f<X: Copy>(x: &[X]) -> u8"), "{before:#?}");
    assert!(
        before.contains("impl Clone for c::Closed")
            && before.contains("const c::more::N: u32 if feature = \"more\"")
    );
    let after = |from: &str, to: &str| {
        assert_eq!(CRATE.matches(from).count(), 1, "{from}");
        lines(&CRATE.replace(from, to))
    };
    for (from, to) in [
        ("pub struct Built { pub a: f64 }", "pub struct Built { pub a: f32 }"),
        ("pub struct Built { pub a: f64 }", "pub struct Built { pub a: f64, pub b: f64 }"),
        ("#[derive(Clone)] ", ""),
        ("pub const fn a(&self)", "pub fn a(&self)"),
        ("A, B", "A, B, C"),
        ("fn required(&self);", "fn required(&self); fn another(&self);"),
        ("fn provided(&self) {}", "fn provided(&self);"),
        ("fn provided(&self) {}", ""),
        ("x: &[X]", "x: &mut [X]"),
        ("#[cfg(feature = \"more\")] ", "#[cfg(feature = \"other\")] "),
    ] {
        assert!(!before.is_subset(&after(from, to)), "{from} became {to}: nothing went");
    }
    for (from, to) in [
        ("pub struct Closed { pub a: f64", "pub struct Closed { pub a: f64, pub c: f64"),
        ("pub enum Open { A }", "pub enum Open { A, B }"),
        ("fn provided(&self) {}", "fn provided(&self) {} fn another(&self) {}"),
        ("pub enum E", "pub fn new() {} pub enum E"),
    ] {
        let after = after(from, to);
        assert!(before.is_subset(&after) && before != after, "{from} became {to}: no addition");
    }
    for (from, to) in [
        ("b: u8", "b: u16"),
        ("fn b(&self) {}", ""),
        ("pub fn f() {}", "pub fn g() {}"),
        ("pub fn t() {}", ""),
    ] {
        assert_eq!(before, after(from, to), "{from} became {to}: nobody outside can tell");
    }
}

#[test]
fn a_released_version_is_followed_by_one_that_says_what_changed() {
    let api = |version: &str, lines: &[&str]| Api {
        version: parsed(version),
        lines: lines.iter().map(ToString::to_string).collect(),
    };
    for (old, new, lines, is_allowed) in [
        ("0.1.0", "0.1.0", &["a", "b"][..], true),
        ("0.1.0", "0.1.0", &["a", "b", "c"], false),
        ("0.1.0", "0.1.1", &["a", "b", "c"], true),
        ("0.1.0", "0.1.1", &["a"], false),
        ("0.1.0", "0.2.0", &["a"], true),
        ("1.1.0", "1.2.0", &["a"], false),
        ("1.1.0", "2.0.0", &["a"], true),
    ] {
        let (old, new) = (api(old, &["a", "b"]), api(new, lines));
        assert_eq!(old.refuses(&new, true).is_none(), is_allowed, "{old:?} {new:?}");
        assert_eq!(old.refuses(&new, false), None, "nobody has it");
        assert_eq!(Api::of_file(&old.to_text()), old);
    }
    assert!(is_released("# Changelog\n\n## [0.1.0] - 2026-12-01\n", [0, 1, 0]));
    assert!(!is_released("## [Unreleased]\n0.1.0\n## [0.1.01]", [0, 1, 0]));
}
