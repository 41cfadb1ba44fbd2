use wgpu::naga;

use super::STAGES;
use super::device::composer;
use super::settings::Stages;
use crate::gpu::Features;
use crate::gpu::compose::MODULES;
use crate::gpu::tests::layout::differences;

/// Module and name of every entry point below `shaders/stages/`.
fn kernels() -> Vec<(&'static str, String)> {
    let of_stages = MODULES
        .iter()
        .filter(|(module, _)| module.starts_with("stages::"));
    of_stages
        .flat_map(|(module, source)| {
            let after = source.split("@compute").skip(1);
            after.filter_map(|text| {
                let (name, _) = text.split_once("fn ")?.1.split_once('(')?;
                Some((*module, name.to_owned()))
            })
        })
        .collect()
}

#[test]
fn every_kernel_is_valid() {
    let kernels = kernels();
    assert!(kernels.len() > STAGES.len(), "{kernels:?}");
    for (module, kernel) in kernels {
        let wgsl = composer()
            .compose(module, &kernel, &Features::default())
            .unwrap_or_else(|error| panic!("{kernel}: {error}"));
        let parsed = naga::front::wgsl::parse_str(&wgsl)
            .unwrap_or_else(|error| panic!("{kernel}: {}", error.emit_to_string(&wgsl)));
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            naga::valid::Capabilities::empty(),
        );
        if let Err(error) = validator.validate(&parsed) {
            panic!("{kernel}: {}", error.emit_to_string(&wgsl));
        }
    }
}

/// That another value would be noticed is shown beside [`differences`].
#[test]
fn what_is_declared_is_the_same_on_both_sides() {
    for stage in STAGES {
        for declared in stage.declared {
            assert!(!declared.constants.is_empty() || !declared.records.is_empty());
            let found = differences(composer(), declared);
            assert!(found.is_empty(), "{}: {found:?}", declared.path());
        }
    }
}

/// A stage that can be asked for is run, and the reverse.
#[test]
fn every_table_has_its_stage() {
    let mut names: Vec<&str> = STAGES.iter().map(|stage| stage.name).collect();
    let mut tables = Stages::TABLES.to_vec();
    names.sort_unstable();
    tables.sort_unstable();
    assert_eq!(names, tables);
    names.pop();
    assert_ne!(names, tables, "control: a stage less");
}
