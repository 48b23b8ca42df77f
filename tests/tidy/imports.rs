//! Finds which files of `src` use which: reads `use` and paths in code, follows re-exports to the
//! file that defines a name, and finds circles.

use std::collections::{BTreeMap, BTreeSet};

/// Module paths, without `crate`: `["rig", "simulated"]`.
type ModulePath = Vec<String>;

/// The import of a single name; `use a::{b, c as d};` has two.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Import {
    path: Vec<String>,
    /// Name in the importing file; `*` if all names are imported.
    name: String,
    public: bool,
}

/// Definitions, imports and used paths of one file.
struct SourceFile {
    name: String,
    at: ModulePath,
    /// Names defined here, at any depth.
    defined: BTreeSet<String>,
    imports: Vec<Import>,
    /// Paths of two words or more in the code outside `use`.
    paths: Vec<Vec<String>>,
    /// Single words in the code outside `use`.
    words: BTreeSet<String>,
}

/// All files of `src`, and the index of each module's file.
pub(crate) struct House {
    files: Vec<SourceFile>,
    modules: BTreeMap<ModulePath, usize>,
}

/// The words and signs of Rust code without comments and strings; `::` is one sign.
fn tokens(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let (mut found, mut i) = (Vec::new(), 0);
    while i < chars.len() {
        let c = at(i);
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == 'r' && (at(i + 1) == '"' || (at(i + 1) == '#' && "#\"".contains(at(i + 2))))
        {
            let hashes = chars[i + 1..].iter().take_while(|&&c| c == '#').count();
            let end: String = std::iter::once('"').chain((0..hashes).map(|_| '#')).collect();
            let inside: String = chars[i + 2 + hashes..].iter().collect();
            let length = inside.split(&end).next().unwrap_or_default().chars().count();
            i += 2 + hashes + length + end.len();
        } else if c == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            i += 2;
            while i < chars.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else if c.is_alphanumeric() || c == '_' {
            let word: String =
                chars[i..].iter().take_while(|c| c.is_alphanumeric() || **c == '_').collect();
            i += word.chars().count();
            found.push(word);
        } else if c == ':' && at(i + 1) == ':' {
            found.push("::".to_owned());
            i += 2;
        } else {
            if !c.is_whitespace() {
                found.push(c.to_string());
            }
            i += 1;
        }
    }
    found
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphabetic() || c == '_')
}

/// Reads the tree of a `use` from `tokens[at]` on; returns where it ends.
fn read_tree(
    tokens: &[String],
    mut at: usize,
    prefix: &[String],
    public: bool,
    into: &mut Vec<Import>,
) -> usize {
    let mut path = prefix.to_vec();
    while let Some(token) = tokens.get(at) {
        match token.as_str() {
            "{" => {
                at += 1;
                while tokens.get(at).is_some_and(|t| t != "}" && t != ";") {
                    at = read_tree(tokens, at, &path, public, into);
                    at += usize::from(tokens.get(at).is_some_and(|t| t == ","));
                }
                return at + 1;
            }
            "::" => at += 1,
            "," | "}" | ";" => break,
            word => {
                path.push(word.to_owned());
                at += 1;
            }
        }
    }
    let mut name = path.last().cloned().unwrap_or_default();
    if let Some(here) = path.iter().position(|word| word == "as") {
        path.truncate(here);
    }
    if name == "self" && path.len() > 1 {
        path.pop();
        name = path.last().cloned().unwrap_or_default();
    }
    into.push(Import { path, name, public });
    at
}

impl SourceFile {
    fn read(name: &str, at: ModulePath, text: &str) -> Self {
        let product = text.split("#[cfg(test)]\nmod ").next().unwrap_or(text);
        let tokens = tokens(product);
        let mut file = SourceFile {
            name: name.to_owned(),
            at,
            defined: BTreeSet::new(),
            imports: Vec::new(),
            paths: Vec::new(),
            words: BTreeSet::new(),
        };
        let mut i = 0;
        while i < tokens.len() {
            let token = tokens[i].as_str();
            let next = tokens.get(i + 1).map_or("", String::as_str);
            match token {
                // `impl Trait + use<>` imports nothing.
                "use" if next != "<" => {
                    let public = i > 0 && matches!(tokens[i - 1].as_str(), "pub" | ")");
                    i = read_tree(&tokens, i + 1, &[], public, &mut file.imports);
                    continue;
                }
                "mod" if is_word(next) => i += 1,
                "fn" | "struct" | "enum" | "trait" | "type" | "const" | "static"
                    if is_word(next) =>
                {
                    file.defined.insert(next.to_owned());
                    i += 1;
                }
                word if is_word(word) && (i == 0 || tokens[i - 1] != "::") => {
                    let mut path = vec![word.to_owned()];
                    while tokens.get(i + 1).is_some_and(|t| t == "::")
                        && tokens.get(i + 2).is_some_and(|t| is_word(t))
                    {
                        path.push(tokens[i + 2].clone());
                        i += 2;
                    }
                    file.words.insert(word.to_owned());
                    if path.len() > 1 {
                        file.paths.push(path);
                    }
                }
                _ => {}
            }
            i += 1;
        }
        file
    }
}

impl House {
    /// Reads files by name and text; tests are skipped.
    pub(crate) fn read<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut house = House { files: Vec::new(), modules: BTreeMap::new() };
        for (name, text) in files {
            let Some(inside) = name.strip_prefix("src/").and_then(|n| n.strip_suffix(".rs")) else {
                continue;
            };
            if inside == "main" || inside.ends_with("tests") || inside.contains("/tests/") {
                continue;
            }
            let words = inside.split('/').filter(|&word| word != "mod" && word != "lib");
            let at: ModulePath = words.map(str::to_owned).collect();
            house.modules.insert(at.clone(), house.files.len());
            house.files.push(SourceFile::read(name, at, text));
        }
        house
    }

    /// The file that defines the item that `path` names in the module `from`; `None` if no file of
    /// this house does, or if `path` names a module.
    fn target(&self, from: &ModulePath, path: &[String], depth: usize) -> Option<usize> {
        let (first, rest) = path.split_first()?;
        let child = || from.iter().chain([first]).cloned().collect::<ModulePath>();
        let (module, rest) = match first.as_str() {
            "crate" | "relens" => (Vec::new(), rest),
            "self" => (from.clone(), rest),
            "super" => {
                let mut parent = from.clone();
                parent.pop()?;
                let mut rest = rest;
                while rest.first().is_some_and(|word| word == "super") {
                    parent.pop()?;
                    rest = &rest[1..];
                }
                (parent, rest)
            }
            _ if self.modules.contains_key(&child()) => (child(), rest),
            _ => {
                let file = &self.files[*self.modules.get(from)?];
                let import = file.imports.iter().find(|import| import.name == *first)?;
                if depth == 0 || import.path.first() == Some(first) {
                    return None;
                }
                let whole: Vec<String> = import.path.iter().chain(rest).cloned().collect();
                return self.target(from, &whole, depth - 1);
            }
        };
        self.walk(module, rest, depth)
    }

    /// Follows the path `rest` down from `module`.
    fn walk(&self, mut module: ModulePath, rest: &[String], depth: usize) -> Option<usize> {
        for (i, word) in rest.iter().enumerate() {
            module.push(word.clone());
            if self.modules.contains_key(&module) {
                continue;
            }
            module.pop();
            let here = *self.modules.get(&module)?;
            let file = &self.files[here];
            if word == "*" || file.defined.contains(word) || depth == 0 {
                return Some(here);
            }
            let passed_on = file.imports.iter().filter(|i| i.name == *word || i.name == "*");
            let found = passed_on.into_iter().find_map(|import| {
                let mut path = import.path.clone();
                if import.name == "*" {
                    *path.last_mut()? = word.clone();
                }
                path.extend(rest[i + 1..].iter().cloned());
                self.target(&module, &path, depth - 1)
            });
            return found.or(Some(here));
        }
        None
    }

    /// For each file, the files that it uses. A `pub use` alone re-exports a name and is not a use.
    fn arrows(&self) -> Vec<BTreeSet<usize>> {
        let mut all = vec![BTreeSet::new(); self.files.len()];
        for (i, file) in self.files.iter().enumerate() {
            let used = file
                .imports
                .iter()
                .filter(|import| !import.public || file.words.contains(&import.name))
                .map(|import| &import.path);
            for path in used.chain(&file.paths) {
                all[i].extend(self.target(&file.at, path, 8).filter(|&to| to != i));
            }
        }
        all
    }

    /// The names of the files in each circle of more than `most` files.
    pub(crate) fn circles(&self, most: usize) -> Vec<Vec<String>> {
        let arrows = self.arrows();
        let reached: Vec<BTreeSet<usize>> = (0..arrows.len())
            .map(|from| {
                let (mut seen, mut open) = (BTreeSet::new(), vec![from]);
                while let Some(at) = open.pop() {
                    open.extend(arrows[at].iter().filter(|&&to| seen.insert(to)));
                }
                seen
            })
            .collect();
        let mut found = BTreeSet::new();
        for from in 0..arrows.len() {
            let circle: Vec<String> = reached[from]
                .iter()
                .filter(|&&to| reached[to].contains(&from))
                .map(|&to| self.files[to].name.clone())
                .collect::<BTreeSet<_>>()
                .into_iter()
                .collect();
            if circle.len() > most {
                found.insert(circle);
            }
        }
        found.into_iter().collect()
    }

    /// Pairs of file names; the first file uses the second.
    pub(crate) fn used(&self) -> BTreeSet<(&str, &str)> {
        let name = |i: usize| self.files[i].name.as_str();
        let arrows = self.arrows();
        arrows
            .iter()
            .enumerate()
            .flat_map(|(i, to)| to.iter().map(move |&to| (i, to)))
            .map(|(from, to)| (name(from), name(to)))
            .collect()
    }
}
