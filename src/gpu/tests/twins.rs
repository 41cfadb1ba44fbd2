//! Every WGSL file has a Rust twin with the same functions in the same order, read off the sources; needs no device.

use std::collections::BTreeSet;
use std::path::Path;

use crate::gpu::compose::MODULES;

/// What is on one side alone: module, functions (`*`: the two sides share none), and why.
const EXCEPTIONS: &[(&str, &str, &str)] = &[
    (
        "accel::trace",
        "*",
        "another tree: eight boxes at a time on the CPU, compressed nodes on the GPU; tests compare the hits",
    ),
    (
        "gpu::buffers",
        "*",
        "the host fills what the shader declares",
    ),
    ("gpu::lanes", "*", "the host fills what the shader declares"),
    (
        "film::sums",
        "opaque",
        "hides error terms from shader compilers, which may reassociate",
    ),
    (
        "film::sums",
        "sum_merge merge value from depth",
        "films are merged and read on the host",
    ),
    (
        "film::sums",
        "add add_nothing",
        "the CPU's samples come as records; the host counts those out of reach",
    ),
    (
        "film::groups",
        "values merge",
        "films are merged and read on the host",
    ),
    ("camera::lens", "xyz", "WGSL writes v.xyz"),
    ("math", "floor", "WGSL has it"),
    (
        "light::environment",
        "row_edges",
        "the CPU looks up what follows from a row's edges",
    ),
    (
        "distortion",
        "sqrt atan opencv fisheye is_none is_regular newton undistort fisheye_angle",
        "the proof, in f64, when a scene is read",
    ),
    (
        "cpu::state",
        "renew",
        "the CPU uses states again; a shader writes the parts that it needs",
    ),
    ("cpu::vertex", "max_element", "glam has it"),
    (
        "material::facets",
        "table_of kept",
        "tables are made on the host",
    ),
    (
        "cpu::photons::emission",
        "no_emission",
        "a constant in Rust",
    ),
    (
        "cpu::photons::path",
        "first_landing",
        "the host learns the guide",
    ),
    (
        "cpu::estimator",
        "is_without_turn evaluations_before",
        "the host counts what it need not send, and evaluations",
    ),
    (
        "cpu::sharing",
        "number_of tile_lanes",
        "the CPU passes the members of a tile; a lane finds them",
    ),
    (
        "cpu::request",
        "trace",
        "picks the CPU's tree of a world; the shader's trace has both",
    ),
    (
        "cpu::request",
        "answer_past",
        "two loops on the CPU, of which a scene asks for one; a shader is made for its scene",
    ),
    (
        "stages::antialias",
        "source_at blended",
        "a thread reads one pixel; the CPU walks rows",
    ),
    (
        "stages::noise",
        "is_untouched",
        "a thread reads one pixel; on the CPU a method of the input",
    ),
    (
        "stages::noise::textures",
        "generate placement normal rng",
        "textures are made on the host",
    ),
    (
        "stages::noise::field",
        "of reach new cholesky",
        "kernels are fitted on the host",
    ),
    (
        "stages::noise::missing",
        "sigma_table",
        "a table made on the host",
    ),
    (
        "stages::sharpness",
        "planes reach variance_gain sharpen near_virtual",
        "the host splits the composite and finds the filter's reach; the CPU walks rows",
    ),
    (
        "stages::motion_blur::copies",
        "of draw_copies",
        "the CPU walks rows; the GPU's kernel is in gpu.wgsl",
    ),
    (
        "stages::cartoon",
        "tap",
        "a thread finds its own tap; the CPU makes them a row at a time",
    ),
    (
        "stages::cartoon::edges",
        "response simplified_yuv simplified_gradients image_gradients responses gradient_row",
        "a thread reads its neighbours; the CPU walks rows with vector instructions",
    ),
    (
        "stages::cartoon::flow",
        "place tensor luma_sample across_sample tangent_nearest new at sample half_gaussian flow_weights lines nearest tangents",
        "a thread reads its neighbours; the CPU walks whole planes",
    ),
    (
        "stages::cartoon::simplify",
        "simplified_at covers filter_row",
        "a thread reads its neighbours; the CPU walks rows with vector instructions",
    ),
    (
        "stages::cartoon::planes",
        "rgb_at yuv_at new of_image fill_rows row",
        "a thread reads one pixel; the CPU walks whole planes",
    ),
];

type Exceptions = &'static [(&'static str, &'static str, &'static str)];

/// Each function of each exception.
fn exceptions(list: Exceptions) -> impl Iterator<Item = (&'static str, &'static str)> {
    list.iter()
        .flat_map(|(module, names, _)| names.split(' ').map(|name| (*module, name)))
}

/// Namesakes with another number of arguments, scene and thread not counted: module, functions, and why.
const OTHER_ARGUMENTS: &[(&str, &str, &str)] = &[
    (
        "cpu::state",
        "path_state",
        "a shader's sample has a lane, where the parts of its state lie",
    ),
    (
        "cpu::sharing",
        "link_probability link_points gather",
        "the CPU passes the members of a tile and what they have; a lane finds them",
    ),
    (
        "cpu::photons::path",
        "trace_photon",
        "a shader lists splats itself",
    ),
    (
        "film::sums",
        "two_sum sum_add sum3_add pixel_add pixel_add_real guide_add",
        "`zero` hides intermediate sums from shader compilers",
    ),
    (
        "film::groups",
        "group_add",
        "`zero` hides intermediate sums from shader compilers",
    ),
    (
        "material::surface",
        "perturbed",
        "WGSL has no pattern for three vertices",
    ),
    (
        "material::texture",
        "texel texture_sample",
        "a shader finds the texels bound",
    ),
    (
        "stages::noise::field",
        "mixed",
        "a shader finds the field bound",
    ),
    (
        "stages::noise::missing",
        "sigma_of bin_of missing_sigma",
        "a shader finds settings and planes bound",
    ),
    (
        "stages::sharpness",
        "sharpened",
        "a shader finds settings and planes bound",
    ),
    (
        "stages::noise::textures",
        "variation",
        "a shader finds settings and textures bound",
    ),
    (
        "stages::motion_blur::copies",
        "layer_at texel",
        "a shader finds the layer bound",
    ),
    (
        "stages::cartoon::edges",
        "sobel",
        "WGSL takes the neighbours one by one; the CPU rows of them",
    ),
    (
        "stages::cartoon::flow",
        "blurred across along",
        "a shader finds the planes bound",
    ),
    (
        "stages::cartoon::simplify",
        "shrink filter",
        "a shader finds the planes bound",
    ),
];

/// Where kernels begin: the Rust twin is their host, which calls them by name.
const KERNEL_MODULES: &[&str] = &["gpu::kernels", "gpu::photons", "::gpu"];

fn is_kernel_module(module: &str) -> bool {
    KERNEL_MODULES
        .iter()
        .any(|kernels| module.ends_with(kernels))
}

/// The text of `src/` that `module` twins.
fn rust_twin(module: &str) -> Option<String> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let path = module.replace("::", "/");
    [format!("{path}.rs"), format!("{path}/mod.rs")]
        .iter()
        .find_map(|file| std::fs::read_to_string(src.join(file)).ok())
}

/// A function of a source.
#[derive(Debug, PartialEq)]
struct Function {
    name: String,
    /// How many; what one side passes and the other finds without is left out.
    arguments: usize,
    is_kernel: bool,
}

/// Functions of a source, tests and comments left out, each once, in order; WGSL's `name_` where `name` is taken is `name`.
fn functions(source: &str) -> Vec<Function> {
    let (source, _) = source.split_once("#[cfg(test)]").unwrap_or((source, ""));
    let code: String = source
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .flat_map(|line| [line, "\n"])
        .collect();
    let mut functions: Vec<Function> = Vec::new();
    for (at, _) in code.match_indices("fn ") {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[at + 3..];
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
        let name = rest[..end.unwrap_or(rest.len())].trim_end_matches('_');
        if name.is_empty() || functions.iter().any(|known| known.name == name) {
            continue;
        }
        let line_before = code[..at].trim_end().lines().last().unwrap_or_default();
        functions.push(Function {
            name: name.to_owned(),
            arguments: arguments(rest)
                .filter(|argument| !is_given(argument))
                .count(),
            is_kernel: line_before.starts_with("@compute"),
        });
    }
    functions
}

/// The arguments of a function, whose text goes on after `fn `.
fn arguments(function: &str) -> impl Iterator<Item = &str> {
    let parts = |text: &str, open: usize| {
        let mut depth = 0;
        let mut cuts = vec![open + 1];
        for (at, c) in text.char_indices().skip_while(move |(at, _)| *at < open) {
            match c {
                '(' | '[' | '<' => depth += 1,
                ')' | ']' => depth -= 1,
                '>' if !text[..at].ends_with('-') => depth -= 1,
                ',' if depth == 1 => cuts.push(at + 1),
                _ => {}
            }
            if depth == 0 {
                cuts.push(at + 1);
                break;
            }
        }
        cuts
    };
    let generics = match function.find(['(', '<']) {
        Some(at) if function[at..].starts_with('<') => parts(function, at).pop().unwrap_or(0),
        _ => 0,
    };
    let open = function[generics..].find('(').map_or(0, |at| generics + at);
    let cuts = parts(function, open);
    cuts.windows(2)
        .map(|cut| function[cut[0]..cut[1] - 1].trim())
        .filter(|argument| !argument.is_empty())
        .collect::<Vec<&str>>()
        .into_iter()
}

/// Rust passes the scene, which a shader finds bound; a shader passes the number of its thread.
fn is_given(argument: &str) -> bool {
    let Some((name, kind)) = argument.split_once(':') else {
        return false;
    };
    let kind = kind.trim();
    name == "thread" || kind == "&PackedScene" || kind == "&Frame"
}

/// What is wrong with `module`; notes the exceptions that it needs.
fn problems(module: &str, wgsl: &str, needed: &mut BTreeSet<(&str, &str)>) -> Vec<String> {
    let rust = rust_twin(module);
    if is_kernel_module(module) {
        // The wavefront's kernels are called by several files.
        let Some(rust) = rust else {
            return Vec::new();
        };
        return functions(wgsl)
            .iter()
            .filter(|function| {
                function.is_kernel && !rust.contains(&format!("\"{}\"", function.name))
            })
            .map(|function| format!("{module}: no one calls {}", function.name))
            .collect();
    }
    let Some(rust) = rust else {
        return vec![format!("{module} has no twin in src/")];
    };
    let sides = [functions(wgsl), functions(&rust)];
    let mut found = Vec::new();
    let mut excused = |list, name: &str| {
        let exception =
            exceptions(list).find(|(of, what)| *of == module && (*what == "*" || *what == name));
        needed.extend(exception);
        exception.is_some()
    };
    let namesake =
        |name: &str, there: &[Function]| there.iter().position(|other| other.name == name);
    for (here, there, side) in [
        (&sides[0], &sides[1], "WGSL"),
        (&sides[1], &sides[0], "Rust"),
    ] {
        for Function { name, .. } in here {
            if namesake(name, there).is_none() && !excused(EXCEPTIONS, name) {
                found.push(format!("{module}: {name} is in {side} alone"));
            }
        }
    }
    let mut places = Vec::new();
    for function in &sides[0] {
        let Some(place) = namesake(&function.name, &sides[1]) else {
            continue;
        };
        places.push(place);
        let other = &sides[1][place];
        if function.arguments != other.arguments && !excused(OTHER_ARGUMENTS, &function.name) {
            found.push(format!(
                "{module}: {} takes {} in WGSL, {} in Rust",
                function.name, function.arguments, other.arguments
            ));
        }
    }
    if !places.is_sorted() {
        found.push(format!("{module}: another order"));
    }
    found
}

#[test]
fn every_shader_has_a_twin_with_the_same_functions() {
    let mut needed = BTreeSet::new();
    let found: Vec<String> = MODULES
        .iter()
        .flat_map(|(module, wgsl)| problems(module, wgsl, &mut needed))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
    let idle: Vec<_> = [EXCEPTIONS, OTHER_ARGUMENTS]
        .into_iter()
        .flat_map(exceptions)
        .filter(|exception| !needed.contains(exception))
        .collect();
    assert!(idle.is_empty(), "exceptions that nothing needs: {idle:?}");
}

#[test]
fn a_file_without_twin_and_functions_that_differ_are_noticed() {
    let mut needed = BTreeSet::new();
    let mut check = |module: &str, wgsl: &str| problems(module, wgsl, &mut needed);
    assert_eq!(
        check("light::planted", "fn f() {}"),
        ["light::planted has no twin in src/"]
    );
    let (module, wgsl) = MODULES
        .iter()
        .find(|(module, _)| *module == "material::fresnel")
        .expect("is embedded");
    assert!(check(module, wgsl).is_empty());
    let renamed = wgsl.replace("fn schlick(", "fn slick(");
    assert_eq!(check(module, &renamed).len(), 2);
    let moved = format!("fn fresnel_dielectric(cos: f32, index: f32) {{}}\n{wgsl}");
    assert_eq!(check(module, &moved).len(), 1);
    let longer = wgsl.replacen("fn schlick(", "fn schlick(more: vec4<f32>, ", 1);
    assert_eq!(check(module, &longer).len(), 1);
    let (module, wgsl) = MODULES
        .iter()
        .find(|(module, _)| *module == "stages::noise::gpu")
        .expect("is embedded");
    assert!(check(module, wgsl).is_empty());
    let renamed = wgsl.replace("fn stage_white(", "fn stage_grey(");
    assert_eq!(
        check(module, &renamed),
        ["stages::noise::gpu: no one calls stage_grey"]
    );
}

#[test]
fn arguments_are_told_apart() {
    let counted = functions(
        "fn a() {} fn b<T: Fn(u32, u32) -> u32>(x: [T; 2], y: Option<(u32, u32)>,) {} fn c(scene: &PackedScene, thread: u32, x: u32)",
    );
    let counts: Vec<usize> = counted.iter().map(|function| function.arguments).collect();
    assert_eq!(counts, [0, 2, 1]);
}

/// Numbers are declared in Rust, for both sides; what stands in a shader alone is made of them.
#[test]
fn shaders_declare_no_numbers_of_their_own() {
    let numbers = |wgsl: &str| -> Vec<String> {
        wgsl.lines()
            .filter(|line| line.starts_with("const ") && line.contains(": "))
            .filter(|line| !line.contains(": Hit ="))
            .map(str::to_owned)
            .collect()
    };
    for (module, wgsl) in MODULES {
        assert_eq!(numbers(wgsl), [""; 0], "{module}");
    }
    // Negative control.
    assert_eq!(numbers("const PLANTED: f32 = 1.0;").len(), 1);
}
