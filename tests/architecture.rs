//! No circles: who may use whom in src/ is the table of layers in docs/architecture.md.
//!
//! Every `use` and every path in the sources is followed, through re-exports, to the file that defines what it names. Test code is not read: it may
//! look at everything.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use proc_macro2::{TokenStream, TokenTree};
use syn::visit::{self, Visit};

/// A module by its names from the crate's root.
type Module = Vec<String>;

/// What a name in a module stands for.
enum Name {
    Module,
    Item,
    /// This path, seen from the module.
    Import(Vec<String>),
}

#[derive(Default)]
struct Contents {
    names: BTreeMap<String, Name>,
    /// `use path::*`
    globs: Vec<Vec<String>>,
    /// Every path that is written in it, imports too.
    paths: BTreeSet<Vec<String>>,
    /// The file's module, where this one is written in another's file.
    file: Module,
}

type Crate = BTreeMap<Module, Contents>;

/// One file uses what another defines.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Arrow {
    from: Module,
    to: Module,
}

fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else {
            return attribute.path().is_ident("test");
        };
        let condition = list.tokens.to_string();
        list.path.is_ident("cfg") && (condition == "test" || condition.starts_with("all (test"))
    })
}

/// Sources by their module; the root is empty.
fn read(sources: &BTreeMap<Module, String>) -> Crate {
    let mut modules = Crate::new();
    // Parents first, so that files of test modules are known to be such.
    let mut tests = BTreeSet::new();
    for (module, source) in sources {
        if (0..=module.len()).any(|n| tests.contains(&module[..n])) {
            continue;
        }
        let file = syn::parse_file(source).unwrap_or_else(|error| panic!("{module:?}: {error}"));
        read_items(&file.items, module, module, &mut modules, &mut tests);
    }
    modules
}

fn read_items(
    items: &[syn::Item],
    module: &Module,
    file: &Module,
    modules: &mut Crate,
    tests: &mut BTreeSet<Module>,
) {
    let mut contents = Contents {
        file: file.clone(),
        ..Contents::default()
    };
    for item in items {
        let (attributes, name) = match item {
            syn::Item::Const(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Enum(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Fn(x) => (&x.attrs, Some(&x.sig.ident)),
            syn::Item::Macro(x) => (&x.attrs, x.ident.as_ref()),
            syn::Item::Mod(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Static(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Struct(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Trait(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Type(x) => (&x.attrs, Some(&x.ident)),
            syn::Item::Use(x) => (&x.attrs, None),
            syn::Item::Impl(x) => (&x.attrs, None),
            _ => continue,
        };
        if is_test(attributes) {
            if let syn::Item::Mod(child) = item {
                tests.insert([module.as_slice(), &[child.ident.to_string()]].concat());
            }
            continue;
        }
        if let Some(name) = name {
            let kind = match item {
                syn::Item::Mod(_) => Name::Module,
                _ => Name::Item,
            };
            contents.names.insert(name.to_string(), kind);
        }
        match item {
            syn::Item::Mod(child) => {
                if let Some((_, items)) = &child.content {
                    let path = [module.as_slice(), &[child.ident.to_string()]].concat();
                    read_items(items, &path, file, modules, tests);
                }
            }
            _ => Paths(&mut contents).visit_item(item),
        }
    }
    modules.insert(module.clone(), contents);
}

/// Gathers what is written.
struct Paths<'a>(&'a mut Contents);

impl Paths<'_> {
    fn import(&mut self, tree: &syn::UseTree, before: &[String]) {
        let with = |name: String| [before, &[name]].concat();
        match tree {
            syn::UseTree::Path(path) => self.import(&path.tree, &with(path.ident.to_string())),
            syn::UseTree::Name(name) if name.ident == "self" => {
                self.name(before.last().cloned(), before.to_vec());
            }
            syn::UseTree::Name(name) => {
                self.name(Some(name.ident.to_string()), with(name.ident.to_string()));
            }
            syn::UseTree::Rename(name) => {
                let path = match name.ident == "self" {
                    true => before.to_vec(),
                    false => with(name.ident.to_string()),
                };
                self.name(Some(name.rename.to_string()), path);
            }
            syn::UseTree::Glob(_) => self.0.globs.push(before.to_vec()),
            syn::UseTree::Group(group) => {
                group
                    .items
                    .iter()
                    .for_each(|tree| self.import(tree, before));
            }
        }
    }

    fn name(&mut self, name: Option<String>, path: Vec<String>) {
        self.0.paths.insert(path.clone());
        if let Some(name) = name {
            // `use a::b;` in a function is read as the file's own: no harm, as no file names two things alike.
            self.0.names.entry(name).or_insert(Name::Import(path));
        }
    }

    /// `a::b::c` anywhere in what a macro is given.
    fn tokens(&mut self, tokens: TokenStream) {
        let (mut path, mut colons) = (Vec::new(), 0);
        for token in tokens {
            match token {
                TokenTree::Punct(punct) if punct.as_char() == ':' => colons += 1,
                TokenTree::Ident(ident) => {
                    if colons != 2 {
                        self.end(&mut path);
                    }
                    path.push(ident.to_string());
                    colons = 0;
                }
                other => {
                    self.end(&mut path);
                    colons = 0;
                    if let TokenTree::Group(group) = other {
                        self.tokens(group.stream());
                    }
                }
            }
        }
        self.end(&mut path);
    }

    fn end(&mut self, path: &mut Vec<String>) {
        if path.len() > 1 {
            self.0.paths.insert(path.clone());
        }
        path.clear();
    }
}

impl<'ast> Visit<'ast> for Paths<'_> {
    fn visit_item_use(&mut self, item: &'ast syn::ItemUse) {
        if !is_test(&item.attrs) {
            self.import(&item.tree, &[]);
        }
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let names: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if names.len() > 1 {
            self.0.paths.insert(names);
        }
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, invoked: &'ast syn::Macro) {
        self.visit_path(&invoked.path);
        self.tokens(invoked.tokens.clone());
    }
}

/// The module whose file defines what this path names; none for other crates' things.
fn definition(modules: &Crate, from: &Module, path: &[String], depth: u32) -> Option<Module> {
    let (first, rest) = path.split_first()?;
    let mut at = match first.as_str() {
        "crate" => Module::new(),
        "self" => from.clone(),
        "super" => from.split_last()?.1.to_vec(),
        _ => return named(modules, from, path, depth),
    };
    let mut rest = rest;
    while let Some((_, after)) = rest.split_first().filter(|(first, _)| *first == "super") {
        at.pop();
        rest = after;
    }
    named(modules, &at, rest, depth)
}

fn named(modules: &Crate, at: &Module, path: &[String], depth: u32) -> Option<Module> {
    let Some((first, rest)) = path.split_first() else {
        return Some(at.clone());
    };
    if depth == 0 {
        return None;
    }
    let contents = modules.get(at)?;
    match contents.names.get(first) {
        Some(Name::Module) => {
            let child = [at.as_slice(), std::slice::from_ref(first)].concat();
            named(modules, &child, rest, depth)
        }
        Some(Name::Item) => Some(at.clone()),
        Some(Name::Import(import)) if import.first() == Some(first) && import.len() == 1 => None,
        Some(Name::Import(import)) => {
            let whole = [import.as_slice(), rest].concat();
            definition(modules, at, &whole, depth - 1)
        }
        None => contents.globs.iter().find_map(|glob| {
            let place = definition(modules, at, glob, depth - 1)?;
            (place != *at).then(|| named(modules, &place, path, depth - 1))?
        }),
    }
}

/// All arrows between files, without those from a module to one that it is inside of.
fn arrows(modules: &Crate) -> BTreeSet<Arrow> {
    let mut arrows = BTreeSet::new();
    for (module, contents) in modules {
        for path in contents.paths.iter().chain(&contents.globs) {
            let Some(place) = definition(modules, module, path, 16) else {
                continue;
            };
            let Some(to) = modules.get(&place).map(|contents| &contents.file) else {
                continue;
            };
            if !contents.file.starts_with(to) {
                arrows.insert(Arrow {
                    from: contents.file.clone(),
                    to: to.clone(),
                });
            }
        }
    }
    arrows
}

/// Layers from the ground up: modules of a line know those of lines before, and nothing of each other.
fn layers(page: &str) -> Vec<Vec<Module>> {
    let section = page
        .split_once("<!-- layers -->")
        .and_then(|(_, rest)| rest.split_once("<!-- end -->"))
        .expect("docs/architecture.md has a section <!-- layers --> ... <!-- end -->")
        .0;
    let rows = section.lines().filter(|line| line.starts_with("| "));
    // A heading and a ruler.
    let cells = rows.skip(1).filter(|row| !row.starts_with("| ---"));
    cells
        .map(|row| {
            let modules = row.split('|').nth(1).unwrap_or("");
            let names = modules
                .split([',', ' ', '`'])
                .filter(|name| !name.is_empty());
            names.map(module).collect()
        })
        .collect()
}

/// What is wrong with the arrows between the listed modules, a line each.
fn upward(modules: &Crate, arrows: &BTreeSet<Arrow>, layers: &[Vec<Module>]) -> Vec<String> {
    // Of a module and one inside of it that is listed too, the inner counts.
    let listed = |of: &Module| {
        let all = layers.iter().enumerate();
        let all = all.flat_map(|(height, layer)| layer.iter().map(move |name| (height, name)));
        let around = all.filter(|(_, name)| of.starts_with(name));
        around.max_by_key(|(_, name)| name.len())
    };
    let mut problems = Vec::new();
    for module in modules.keys().filter(|module| !module.is_empty()) {
        if listed(module).is_none() {
            problems.push(format!("{} stands in no layer", module.join("::")));
        }
    }
    for module in layers.iter().flatten() {
        if !modules.contains_key(module) {
            problems.push(format!("there is no {}", module.join("::")));
        }
    }
    for Arrow { from, to } in arrows {
        // The root hands on names; it may know all.
        let (Some((height, user)), Some((used_height, used))) = (listed(from), listed(to)) else {
            continue;
        };
        if user != used && height <= used_height {
            problems.push(format!("{} uses {}", from.join("::"), to.join("::")));
        }
    }
    problems
}

/// The arrows along which files need each other.
fn circles(arrows: &BTreeSet<Arrow>) -> Vec<String> {
    let mut used_by: BTreeMap<&Module, Vec<&Module>> = BTreeMap::new();
    for Arrow { from, to } in arrows {
        used_by.entry(from).or_default().push(to);
    }
    let leads_to = |start: &Module, end: &Module| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![start]);
        while let Some(module) = next.pop() {
            if module == end {
                return true;
            }
            if seen.insert(module) {
                next.extend(used_by.get(module).into_iter().flatten());
            }
        }
        false
    };
    let in_circle = arrows
        .iter()
        .filter(|arrow| leads_to(&arrow.to, &arrow.from));
    let line = |arrow: &Arrow| format!("{} -> {}", arrow.from.join("::"), arrow.to.join("::"));
    in_circle.map(line).collect()
}

fn sources_of(folder: &Path, module: &Module, sources: &mut BTreeMap<Module, String>) {
    for entry in std::fs::read_dir(folder).expect("src/ can be read") {
        let path = entry.expect("src/ can be read").path();
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let child = [module.as_slice(), std::slice::from_ref(&name)].concat();
        if path.is_dir() {
            sources_of(&path, &child, sources);
        } else if path.extension().is_some_and(|extension| extension == "rs") && name != "main" {
            let of_folder = matches!(name.as_str(), "mod" | "lib");
            let source = std::fs::read_to_string(&path).expect("a source can be read");
            sources.insert(if of_folder { module.clone() } else { child }, source);
        }
    }
}

fn this_crate() -> BTreeMap<Module, String> {
    let mut sources = BTreeMap::new();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    sources_of(&root, &Module::new(), &mut sources);
    sources
}

fn this_page() -> Vec<Vec<Module>> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/architecture.md");
    layers(&std::fs::read_to_string(page).expect("docs/architecture.md can be read"))
}

fn module(name: &str) -> Module {
    name.split("::").map(str::to_owned).collect()
}

#[test]
fn no_module_uses_one_above_it() {
    let layers = this_page();
    let modules = read(&this_crate());
    let arrows = arrows(&modules);
    assert!(
        arrows.len() > 200,
        "the sources were read: {}",
        arrows.len()
    );
    let problems = upward(&modules, &arrows, &layers);
    assert!(problems.is_empty(), "{}", problems.join("\n"));

    // Controls: an arrow up, through a name that another module hands on, and in the words given to a macro.
    for planted in [
        "use crate::renderer::Renderer;",
        "use crate::{film, renderer};",
        "fn f() { println!(\"{}\", crate::renderer::SCRAMBLES) }",
        "fn f(x: &crate::renderer::Renderer) {}",
    ] {
        let mut sources = this_crate();
        let math = sources.get_mut(&module("math")).expect("src/math.rs");
        math.push_str(planted);
        let modules = read(&sources);
        let problems = upward(&modules, &self::arrows(&modules), &layers);
        assert!(
            problems.iter().any(|p| p.starts_with("math uses renderer")),
            "{planted}: {problems:?}"
        );
    }
}

#[test]
fn no_file_needs_one_that_needs_it() {
    let arrows = arrows(&read(&this_crate()));
    let circles = circles(&arrows);
    assert!(circles.is_empty(), "{}", circles.join("\n"));

    // Control: a child may use what its parent holds, but not a sister that uses it, however the name is handed on.
    let circle = |second: &str| {
        let sources = [
            ("a", "mod b; mod c; pub use b::B; pub struct A;"),
            ("a::b", "use super::{A, c::C}; pub struct B(A, C);"),
            ("a::c", second),
        ];
        let mut sources: BTreeMap<Module, String> = sources
            .iter()
            .map(|(name, text)| (module(name), (*text).to_owned()))
            .collect();
        sources.insert(Module::new(), "mod a;".to_owned());
        self::circles(&self::arrows(&read(&sources)))
    };
    assert_eq!(circle("use super::A; pub struct C;"), [""; 0]);
    assert_eq!(
        circle("use super::B; pub struct C;"),
        ["a::b -> a::c", "a::c -> a::b"]
    );
    assert_eq!(
        circle("#[cfg(test)] mod tests { use super::super::B; } pub struct C;"),
        [""; 0]
    );
}

/// Names that lib.rs shows on purpose, and modules that it shows by mistake.
fn face(root: &str) -> (Vec<String>, Vec<String>) {
    let file = syn::parse_file(root).expect("src/lib.rs is Rust");
    let mut contents = Contents::default();
    let mut open = Vec::new();
    for item in &file.items {
        match item {
            syn::Item::Use(item) if matches!(item.vis, syn::Visibility::Public(_)) => {
                Paths(&mut contents).import(&item.tree, &[]);
            }
            syn::Item::Mod(item) if matches!(item.vis, syn::Visibility::Public(_)) => {
                let is_hidden = |attribute: &syn::Attribute| match &attribute.meta {
                    syn::Meta::List(list) => {
                        list.path.is_ident("doc") && list.tokens.to_string() == "hidden"
                    }
                    _ => false,
                };
                if !item.attrs.iter().any(is_hidden) {
                    open.push(item.ident.to_string());
                }
            }
            _ => {}
        }
    }
    (contents.names.into_keys().collect(), open)
}

#[test]
fn the_library_shows_about_forty_names() {
    let sources = this_crate();
    let root = &sources[&Module::new()];
    let (names, open) = face(root);
    assert!(
        (35..=50).contains(&names.len()),
        "{}: {names:?}",
        names.len()
    );
    assert_eq!(open, [""; 0], "hidden from the docs");

    let planted = format!("{root}\npub mod planted;\npub use planted::Planted;");
    let (more, open) = face(&planted);
    assert_eq!(
        (more.len(), open),
        (names.len() + 1, vec!["planted".to_owned()]),
        "control"
    );
}
