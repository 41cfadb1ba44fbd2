//! What Rust declares for the shaders against what the shaders make of it, by naga's reflection of composed code; needs no device.

use std::collections::HashMap;

use wgpu::naga;

use crate::gpu::compose::{Composer, DECLARED, Features, item_name};
use crate::shared::{Module, Value};

/// Bytes of an array's element; name, offset and size of the fields.
type RecordLayout<'a> = (usize, Vec<(&'a str, usize, usize)>);

/// A composed and parsed kernel that uses every constant and record of a declaration.
struct Reflected {
    module: naga::Module,
    layouter: naga::proc::Layouter,
}

impl Reflected {
    fn of(composer: Composer, declared: &Module) -> Self {
        let constants = declared.constants.iter().map(|constant| constant.name);
        let records = declared.records.iter().map(|record| record.name);
        let names: Vec<&str> = constants.clone().chain(records.clone()).collect();
        let uses: String = constants
            .map(|name| format!("_ = {name};\n"))
            .chain(records.map(|name| format!("var a_{name}: {name}; _ = &a_{name};\n")))
            .collect();
        let root = format!(
            "import package::{}::{{{}}};\n@compute @workgroup_size(1) fn main() {{\n{uses}}}",
            declared.path(),
            names.join(", "),
        );
        let wgsl = composer
            .with_module("root", root)
            .compose("root", "main", &Features::ALL)
            .unwrap_or_else(|error| panic!("{}: {error}", declared.path()));
        let module = naga::front::wgsl::parse_str(&wgsl)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&wgsl)));
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("layout");
        Self { module, layouter }
    }

    fn constants(&self) -> HashMap<&str, Value> {
        let literal = |expression: &naga::Expression| match expression {
            naga::Expression::Literal(naga::Literal::U32(x)) => Some(Value::U32(*x)),
            naga::Expression::Literal(naga::Literal::I32(x)) => Some(Value::I32(*x)),
            naga::Expression::Literal(naga::Literal::F32(x)) => Some(Value::F32(*x)),
            _ => None,
        };
        let expressions = &self.module.global_expressions;
        let value = |expression: &naga::Expression| match expression {
            naga::Expression::Compose { components, .. } => {
                let (mut words, mut numbers) = (Vec::new(), Vec::new());
                for part in components {
                    match literal(&expressions[*part])? {
                        Value::U32(x) => words.push(x),
                        Value::F32(x) => numbers.push(x),
                        _ => return None,
                    }
                }
                Some(if numbers.is_empty() {
                    Value::U32s(words)
                } else {
                    Value::F32s(numbers)
                })
            }
            other => literal(other),
        };
        self.module
            .constants
            .iter()
            .filter_map(|(_, constant)| {
                let name = item_name(constant.name.as_deref()?);
                Some((name, value(&expressions[constant.init])?))
            })
            .collect()
    }

    /// By name.
    fn records(&self) -> HashMap<&str, RecordLayout<'_>> {
        self.module
            .types
            .iter()
            .filter_map(|(handle, kind)| {
                let naga::TypeInner::Struct { members, .. } = &kind.inner else {
                    return None;
                };
                let fields = members
                    .iter()
                    .map(|member| {
                        let size = self.layouter[member.ty].size;
                        let name = member.name.as_deref().unwrap_or_default();
                        (name, member.offset as usize, size as usize)
                    })
                    .collect();
                let stride = self.layouter[handle].to_stride() as usize;
                Some((item_name(kind.name.as_deref()?), (stride, fields)))
            })
            .collect()
    }
}

/// Of every constant and record of `declared` that is otherwise in the shaders: its name.
pub(crate) fn differences(composer: Composer, declared: &Module) -> Vec<&'static str> {
    let reflected = Reflected::of(composer, declared);
    let constants = reflected.constants();
    let records = reflected.records();
    let other_constants = declared
        .constants
        .iter()
        .filter(|constant| constants.get(constant.name) != Some(&(constant.value)()))
        .map(|constant| constant.name);
    let other_records = declared
        .records
        .iter()
        .filter(|record| {
            let fields = record.fields.iter();
            if record.is_value {
                let found = records.get(record.name);
                let found = found.map(|(_, fields)| fields.iter().map(|field| field.0));
                return !found.is_some_and(|names| names.eq(fields.map(|field| field.name)));
            }
            let fields = fields.map(|field| (field.name, field.offset, field.size));
            records.get(record.name) != Some(&(record.size, fields.collect()))
        })
        .map(|record| record.name);
    other_constants.chain(other_records).collect()
}

#[test]
fn what_is_declared_is_the_same_on_both_sides() {
    for declared in DECLARED {
        assert!(!declared.constants.is_empty() || !declared.records.is_empty());
        let found = differences(Composer::default(), declared);
        assert!(found.is_empty(), "{}: {found:?}", declared.path());
    }
}

#[test]
fn another_value_and_a_swapped_pair_of_fields_are_noticed() {
    let records = &crate::packed::records::SHARED;
    let text = records.wgsl();
    let changed = [
        (
            "MAX_SPHERES: u32 = 16u",
            "MAX_SPHERES: u32 = 17u",
            "MAX_SPHERES",
        ),
        (
            "    kind: u32,\n    side: u32,\n",
            "    side: u32,\n    kind: u32,\n",
            "Light",
        ),
        ("    plane_error: f32,\n", "", "Triangle"),
    ];
    for (from, to, name) in changed {
        let other = text.replacen(from, to, 1);
        assert_ne!(other, text, "{from} is not declared");
        let composer = Composer::default().with_module(records.path(), other);
        assert_eq!(differences(composer, records), [name]);
    }
}

#[test]
fn a_swapped_pair_of_fields_of_a_value_is_noticed() {
    let surface = &crate::material::surface::SHARED;
    let text = surface.wgsl();
    let (from, to) = (
        "metallic: f32,\n    ggx_alpha",
        "ggx_alpha: f32,\n    metallic",
    );
    assert!(text.contains(from), "{text}");
    let composer = Composer::default().with_module(surface.path(), text.replacen(from, to, 1));
    assert_eq!(differences(composer, surface), ["Surface"]);
}
