//! Linking: a WESL module and what it imports become one WGSL text.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use wesl::syntax::{GlobalDeclaration, PathOrigin};
use wesl::{
    CompileOptions, Diagnostic, EscapeMangler, Feature, FileResolver, ModulePath, Resolver, Router,
    SourceMap, SyntaxUtil, VirtualResolver,
};

use crate::{LinkError, Place};

/// The name by which scene-core's modules are imported.
const SHARED_PACKAGE: &str = "scene_core";

/// A module linked with all it imports.
#[derive(Clone, Debug, Default)]
pub struct LinkedShader {
    /// The module's name: its file's without ending.
    pub name: String,
    /// Its file.
    pub path: PathBuf,
    /// Plain WGSL.
    pub wgsl: String,
    /// Whether it has an entry point. One that has holds only what its entry points use; one that has none
    /// holds everything, so that all of it can be validated.
    pub has_entry_point: bool,
    /// Where each declaration of `wgsl` comes from.
    pub declarations: Vec<Declaration>,
    /// Every file it was linked from.
    pub sources: Vec<PathBuf>,
}

/// A declaration of a linked shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Declaration {
    /// Its name in the linked WGSL.
    pub linked_name: String,
    /// Its name in the file it comes from.
    pub name: String,
    /// That file.
    pub file: PathBuf,
}

/// The WESL modules in `folder`, in the order of their names.
///
/// # Errors
/// A folder that cannot be read, or holds no module.
pub fn modules(folder: &Path) -> Result<Vec<PathBuf>, LinkError> {
    let fail = |source| LinkError::File { path: folder.to_owned(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.extension().is_some_and(|ending| ending == "wesl") {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(LinkError::Empty { folder: folder.to_owned() });
    }
    Ok(files)
}

/// Links the module in the file `path`, which may import `scene_core::…` from the folder `shared` and `package::…`
/// from the folder `own`; the two may be the same.
///
/// # Errors
/// A broken module, with file and line.
pub fn link_file(path: &Path, own: &Path, shared: &Path) -> Result<LinkedShader, LinkError> {
    link_variant(path, None, own, shared)
}

/// The module in the file `path` as [`link_file`] links it, with what stands behind `@if(!feature)`; and once more for each
/// feature that it or what it imports asks for so, with what stands behind `@if(feature)`. The feature's name then follows
/// the module's. One without entry points comes alone.
///
/// # Errors
/// As [`link_file`].
pub fn link_variants(path: &Path, own: &Path, shared: &Path) -> Result<Vec<LinkedShader>, LinkError> {
    let mut shaders = vec![link_file(path, own, shared)?];
    if shaders[0].has_entry_point {
        for feature in features(&shaders[0].sources)? {
            let variant = link_variant(path, Some(&feature), own, shared)?;
            // One that imports only what the feature does not touch is what it was.
            if variant.wgsl != shaders[0].wgsl {
                shaders.push(variant);
            }
        }
    }
    Ok(shaders)
}

/// The features that these files ask for.
fn features(files: &[PathBuf]) -> Result<BTreeSet<String>, LinkError> {
    let mut features = BTreeSet::new();
    for file in files {
        let text =
            fs::read_to_string(file).map_err(|source| LinkError::File { path: file.clone(), source })?;
        let asked = text.split("@if(").skip(1).filter_map(|rest| rest.split(')').next());
        features.extend(asked.map(|feature| feature.trim_start_matches('!').trim().to_owned()));
    }
    Ok(features)
}

fn link_variant(
    path: &Path,
    feature: Option<&str>,
    own: &Path,
    shared: &Path,
) -> Result<LinkedShader, LinkError> {
    let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    if name.is_empty() || !name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_') {
        return Err(LinkError::Name { path: path.to_owned() });
    }
    let source =
        fs::read_to_string(path).map_err(|source| LinkError::File { path: path.to_owned(), source })?;
    let root = ModulePath::new(PathOrigin::Absolute, vec![name.to_owned()]);
    let mut this = VirtualResolver::new();
    this.add_module(ModulePath::new_root(), source.into());
    let mut router = router(shared);
    router.mount_resolver(root.clone(), this);
    router.mount_fallback_resolver(FileResolver::new(own));
    let mut shader = link(&root, path, feature, &router)?;
    shader.name = feature.map_or_else(|| name.to_owned(), |feature| format!("{name}_{feature}"));
    shader.path = path.to_owned();
    Ok(shader)
}

fn router(shared: &Path) -> Router {
    let mut router = Router::new();
    let prefix = ModulePath::new(PathOrigin::Package(SHARED_PACKAGE.to_owned()), Vec::new());
    router.mount_resolver(prefix, FileResolver::new(shared));
    router
}

fn link(
    root: &ModulePath,
    file: &Path,
    feature: Option<&str>,
    router: &Router,
) -> Result<LinkedShader, LinkError> {
    let fail = |error: wesl::Error| module_error(&error.into(), file, router);
    let module = router.resolve_module(root).map_err(|error| fail(error.into()))?;
    let has_entry_point = module.entry_points().next().is_some();
    let mut options =
        CompileOptions { strip: has_entry_point, lazy: has_entry_point, ..CompileOptions::default() };
    options.features.flags.extend(feature.map(|feature| (feature.to_owned(), Feature::Enable)));
    let linked = wesl::compile_sourcemap(root, router, &EscapeMangler, &options).map_err(fail)?;
    let files = |path: &ModulePath| router.fs_path(path).unwrap_or_else(|| file.to_owned());
    let declarations = linked.syntax.global_declarations.iter().filter_map(|declaration| {
        let linked_name = name_of(declaration.node())?;
        // Names of the root module stay as they are.
        let (path, name) = linked
            .sourcemap
            .as_ref()
            .and_then(|map| map.get_decl(&linked_name))
            .map_or((root, linked_name.as_str()), |(path, name)| (path, name));
        Some(Declaration { name: name.to_owned(), file: files(path), linked_name })
    });
    Ok(LinkedShader {
        wgsl: linked.to_string(),
        has_entry_point,
        declarations: declarations.collect(),
        sources: linked.modules.iter().map(files).collect(),
        ..LinkedShader::default()
    })
}

fn name_of(declaration: &GlobalDeclaration) -> Option<String> {
    let ident = match declaration {
        GlobalDeclaration::Declaration(declaration) => &declaration.ident,
        GlobalDeclaration::TypeAlias(alias) => &alias.ident,
        GlobalDeclaration::Struct(record) => &record.ident,
        GlobalDeclaration::Function(function) => &function.ident,
        GlobalDeclaration::Void | GlobalDeclaration::ConstAssert(_) => return None,
    };
    Some(ident.to_string())
}

/// A diagnostic as file, line and one sentence. `root` is the file that was being linked.
fn module_error(diagnostic: &Diagnostic<wesl::Error>, root: &Path, router: &Router) -> LinkError {
    let detail = &diagnostic.detail;
    let path = detail.module_path.as_ref().and_then(|path| router.fs_path(path));
    let file = path.unwrap_or_else(|| root.to_owned());
    let message = diagnostic.error.to_string();
    let read = |file: &Path| fs::read_to_string(file).unwrap_or_default();
    if let Some(span) = &detail.span {
        let source = detail.source.clone().unwrap_or_else(|| read(&file));
        return LinkError::Module { place: Place::of_offset(file, &source, span.range().start), message };
    }
    // Faults of imports have no span: the place is where the importing file holds the word that the message
    // quotes last.
    let quoted: Vec<_> = message.split('`').skip(1).step_by(2).collect();
    let word = quoted.last().map_or("", |quoted| last_name(quoted));
    let holds = |file: &Path| read(file).find(word).map(|offset| Place::of_offset(file, &read(file), offset));
    let place = holds(root).or_else(|| holds(&file)).unwrap_or_else(|| Place::of_offset(file, "", 0));
    LinkError::Module { place, message }
}

fn last_name(path: &str) -> &str {
    path.rsplit(['/', ':']).next().unwrap_or(path).trim_end_matches(".wgsl").trim_end_matches(".wesl")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    fn link_folder(own: &Path, shared: &Path) -> Result<Vec<LinkedShader>, LinkError> {
        modules(own)?.iter().map(|path| link_file(path, own, shared)).collect()
    }

    const SHARED: (&str, &str) =
        ("maths.wesl", "fn twice(x: f32) -> f32 { return 2.0 * x; }\nfn unused() {}\n");
    const ENTRY: &str = "import scene_core::maths::twice;
@group(0) @binding(0) var<storage, read_write> out: array<f32>;
@compute @workgroup_size(1) fn main() { out[0] = twice(out[0]); }
";

    #[test]
    fn shared_modules_are_linked_and_unused_functions_left_out() {
        let (shared, own) = (folder(&[SHARED]), folder(&[("entry.wesl", ENTRY)]));
        let shaders = link_folder(own.path(), shared.path()).unwrap();
        let [shader] = &shaders[..] else { panic!("{shaders:?}") };
        assert!(shader.has_entry_point && shader.name == "entry");
        assert!(shader.wgsl.contains("twice") && !shader.wgsl.contains("unused"), "{}", shader.wgsl);
        let twice = shader.declarations.iter().find(|d| d.name == "twice").unwrap();
        assert_eq!(twice.file, shared.path().join("maths.wesl"));
        assert!(shader.wgsl.contains(&twice.linked_name));
        assert_eq!(shader.sources.len(), 2);
    }

    #[test]
    fn a_variant_has_what_its_feature_asks_for() {
        let choice = "@if(paged) fn twice(x: f32) -> f32 { return x + x; }
@if(!paged) fn twice(x: f32) -> f32 { return 2.0 * x; }
";
        let (shared, own) = (folder(&[("maths.wesl", choice)]), folder(&[("entry.wesl", ENTRY)]));
        let shaders = link_variants(&own.path().join("entry.wesl"), own.path(), shared.path()).unwrap();
        let [plain, paged] = &shaders[..] else { panic!("{shaders:?}") };
        assert!(plain.name == "entry" && paged.name == "entry_paged");
        assert!(plain.wgsl.contains("2.0") && !plain.wgsl.contains("x + x"), "{}", plain.wgsl);
        assert!(paged.wgsl.contains("x + x") && !paged.wgsl.contains("2.0"), "{}", paged.wgsl);
        // What has no entry point is no shader yet.
        let path = shared.path().join("maths.wesl");
        assert_eq!(link_variants(&path, own.path(), shared.path()).unwrap().len(), 1);
    }

    #[test]
    fn modules_without_entry_points_are_kept_whole() {
        let shared = folder(&[SHARED]);
        let shaders = link_folder(shared.path(), shared.path()).unwrap();
        assert!(!shaders[0].has_entry_point && shaders[0].wgsl.contains("unused"));
    }

    #[test]
    fn a_module_may_lie_beside_the_package() {
        let own = folder(&[("maths.wesl", SHARED.1)]);
        let tests = folder(&[("kernel.wesl", &ENTRY.replace("scene_core", "package"))]);
        let shader = link_file(&tests.path().join("kernel.wesl"), own.path(), own.path()).unwrap();
        assert!(shader.wgsl.contains("twice"));
        assert!(shader.declarations.iter().any(|d| d.file == own.path().join("maths.wesl")));
    }

    #[test]
    fn faults_name_file_and_line() {
        let shared = folder(&[SHARED]);
        let fault = |text: &str| {
            let own = folder(&[("entry.wesl", text)]);
            match link_folder(own.path(), shared.path()) {
                Err(LinkError::Module { place, .. }) => {
                    (place.file.file_name().unwrap().to_str().unwrap().to_owned(), place.line)
                }
                other => panic!("{other:?}"),
            }
        };
        let entry = "entry.wesl".to_owned();
        assert_eq!(fault("fn f() {}\nfn g( {}\n"), (entry.clone(), 2));
        let missing_module = ENTRY.replace("maths", "nowhere");
        assert_eq!(fault(&missing_module), (entry.clone(), 1));
        let missing_function = ENTRY.replace("twice", "thrice");
        assert_eq!(fault(&missing_function), (entry, 1));
    }

    #[test]
    fn a_folder_without_modules_and_a_bad_name_are_refused() {
        let empty = folder(&[]);
        assert!(matches!(link_folder(empty.path(), empty.path()), Err(LinkError::Empty { .. })));
        let named = folder(&[("Not-A-Name.wesl", "")]);
        assert!(matches!(link_folder(named.path(), named.path()), Err(LinkError::Name { .. })));
    }
}
