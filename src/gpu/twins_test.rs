//! Every WGSL file has a Rust twin with the same functions in the same order, read off the sources; needs no device.

use std::collections::BTreeSet;
use std::path::Path;

use super::compose::MODULES;

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
        "sum_merge merge value depth",
        "films are merged and read on the host",
    ),
    (
        "film::sums",
        "add add_nothing",
        "the CPU's samples come as records; the host counts those out of reach",
    ),
    ("camera::lens", "xyz", "WGSL writes v.xyz"),
    (
        "camera::lens",
        "coefficients",
        "the one formula in Rust takes them as a list; WGSL reads the frame",
    ),
    ("cpu::vertex", "max_element", "glam has it"),
    (
        "cpu::photons::emission",
        "no_emission",
        "a constant in Rust",
    ),
    (
        "cpu::estimator",
        "samples_without_turn",
        "the host counts what it need not send",
    ),
    (
        "cpu::request",
        "trace",
        "picks the CPU's tree of a world; the shader's trace has both",
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

/// Each function of each exception.
fn exceptions() -> impl Iterator<Item = (&'static str, &'static str)> {
    EXCEPTIONS
        .iter()
        .flat_map(|(module, names, _)| names.split(' ').map(|name| (*module, name)))
}

/// Where kernels begin: their host's side drives them by name, and walks the pixels or samples of its own in their place.
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

/// Functions of a source, tests and comments left out, each once, in order; WGSL's `name_` where `name` is taken is `name`.
fn functions(source: &str) -> Vec<String> {
    let (source, _) = source.split_once("#[cfg(test)]").unwrap_or((source, ""));
    let code: String = source
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .flat_map(|line| [line, "\n"])
        .collect();
    let words: Vec<&str> = code
        .split(|c: char| !c.is_alphanumeric() && c != '_')
        .filter(|word| !word.is_empty())
        .collect();
    let mut names: Vec<String> = Vec::new();
    for pair in words.windows(2) {
        let name = pair[1].trim_end_matches('_');
        if pair[0] == "fn" && !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// What is wrong with `module`; notes the exceptions that it needs.
fn problems(module: &str, wgsl: &str, needed: &mut BTreeSet<(&str, &str)>) -> Vec<String> {
    if is_kernel_module(module) {
        return Vec::new();
    }
    let Some(rust) = rust_twin(module) else {
        return vec![format!("{module} has no twin in src/")];
    };
    let sides = [functions(wgsl), functions(&rust)];
    let mut found = Vec::new();
    for (here, there, side) in [
        (&sides[0], &sides[1], "WGSL"),
        (&sides[1], &sides[0], "Rust"),
    ] {
        for name in here.iter().filter(|name| !there.contains(name)) {
            let exception =
                exceptions().find(|(of, what)| *of == module && (*what == "*" || what == name));
            match exception {
                Some(exception) => {
                    needed.insert(exception);
                }
                None => found.push(format!("{module}: {name} is in {side} alone")),
            }
        }
    }
    let [wgsl, rust] = [(&sides[0], &sides[1]), (&sides[1], &sides[0])].map(|(here, there)| {
        let common = here.iter().filter(|name| there.contains(name));
        common.cloned().collect::<Vec<String>>()
    });
    if wgsl != rust {
        found.push(format!("{module}: another order: {wgsl:?}, {rust:?}"));
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
    let idle: Vec<_> = exceptions()
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
    let moved = format!("fn fresnel_dielectric() {{}}\n{wgsl}");
    assert_eq!(check(module, &moved).len(), 1);
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
