//! Runs WGSL functions on plain words, so that a test compares a shader with its Rust twin in a few lines.
//!
//! ```no_run
//! use mixray::gpu::{Features, harness::{Probe, test_device}};
//!
//! let Some(gpu) = test_device() else { return };
//! let inputs: Vec<u32> = (0..1000).collect();
//! let outputs = Probe {
//!     features: Features::default(),
//!     prelude: "fn double(x: u32) -> u32 { return 2u * x; }", // imports first, then declarations
//!     body: "output(0u, double(input(0u)));",
//!     input_words: 1,
//!     output_words: 1,
//!     scene: None,
//! }
//! .run(gpu, &inputs)
//! .unwrap();
//! assert!(inputs.iter().zip(&outputs).all(|(i, o)| 2 * i == *o));
//! ```

use std::cell::OnceCell;
use std::sync::{Arc, Mutex, PoisonError};

use super::{AdapterChoice, Composer, Features, GpuDevice, GpuError, SceneBuffers, kernel::Kernel};
use crate::shared::WORKGROUP;

/// Devices that no test uses at the moment.
static IDLE: Mutex<Vec<&'static Arc<GpuDevice>>> = Mutex::new(Vec::new());

/// A device while one test has it.
struct Lease(&'static Arc<GpuDevice>);

impl Drop for Lease {
    fn drop(&mut self) {
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push(self.0);
    }
}

/// A device for this thread alone, software or not; None, said aloud, where there is none. Threads that come later have it after this one.
///
/// One queue takes one submission after the other, and a software device compiles kernels in them: two tests would wait for each other.
///
/// # Panics
/// With `MIXRAY_REQUIRE_GPU=1` in the environment and no device: there, a skipped test is a failed one.
pub fn test_device() -> Option<&'static Arc<GpuDevice>> {
    thread_local! {
        static OWN: OnceCell<Result<Lease, GpuError>> = const { OnceCell::new() };
    }
    let lease = || {
        let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let gpu = match idle {
            Some(gpu) => gpu,
            None => Box::leak(Box::new(Arc::new(GpuDevice::open(AdapterChoice::Any)?))),
        };
        Ok(Lease(gpu))
    };
    OWN.with(|own| match own.get_or_init(lease) {
        Ok(Lease(gpu)) => Some(*gpu),
        Err(error) => {
            let required = std::env::var("MIXRAY_REQUIRE_GPU").is_ok_and(|value| value == "1");
            assert!(!required, "MIXRAY_REQUIRE_GPU=1, but {error}");
            eprintln!("skipped, GPU code is not tested here: {error}");
            None
        }
    })
}

/// A piece of WGSL that turns `input_words` words into `output_words` words, once for each record of the input.
///
/// The body reads with `input(i)`, `input_f32(i)`, `input_vec3(i)` and writes with `output(i, word)`, `output_f32(i, x)`,
/// `output_vec3(i, v)`, where i counts words of the record.
pub struct Probe<'a> {
    pub features: Features,
    /// `import package::...;` lines, then declarations of its own.
    pub prelude: &'a str,
    /// Statements.
    pub body: &'a str,
    pub input_words: usize,
    pub output_words: usize,
    /// Needed if the functions under test read the scene.
    pub scene: Option<&'a SceneBuffers>,
}

impl Probe<'_> {
    /// The outputs of all records, one after the other; words are `f32::to_bits` where the body writes floats.
    ///
    /// # Errors
    /// The shader does not compile, reads a scene that was not given, or the device was lost.
    pub fn run(&self, gpu: &GpuDevice, inputs: &[u32]) -> Result<Vec<u32>, GpuError> {
        self.run_with(gpu, Composer::default(), inputs)
    }

    /// [`Probe::run`] with modules of the caller's own.
    ///
    /// # Errors
    /// As [`Probe::run`].
    pub fn run_with(
        &self,
        gpu: &GpuDevice,
        composer: Composer,
        inputs: &[u32],
    ) -> Result<Vec<u32>, GpuError> {
        let records = inputs.len() / self.input_words;
        let wgsl = composer.with_module("probe", self.root(records)).compose(
            "probe",
            "probe_main",
            &self.features,
        )?;
        let kernel = Kernel::new(gpu, "probe_main", &wgsl)?;
        let buffer = |words: usize, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("probe"),
                size: 4 * words.max(1) as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        use wgpu::BufferUsages as Usage;
        let input = buffer(inputs.len(), Usage::STORAGE | Usage::COPY_DST);
        gpu.queue
            .write_buffer(&input, 0, bytemuck::cast_slice(inputs));
        let output_words = records * self.output_words;
        let output = buffer(output_words, Usage::STORAGE | Usage::COPY_SRC);
        let staging = buffer(output_words, Usage::MAP_READ | Usage::COPY_DST);
        let groups = kernel.bind(gpu, |name| match name {
            "probe_inputs" => Some(&input),
            "probe_outputs" => Some(&output),
            _ => self.scene?.get(name),
        })?;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.set(&mut pass, &groups);
        pass.dispatch_workgroups((records as u32).div_ceil(WORKGROUP), 1, 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&output, 0, &staging, 0, output.size());
        gpu.submit_and_wait(encoder)?;
        let bytes = gpu.read(&staging, 4 * output_words as u64)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    fn root(&self, records: usize) -> String {
        format!(
            "{prelude}
@group(1) @binding(0) var<storage, read> probe_inputs: array<u32>;
@group(1) @binding(1) var<storage, read_write> probe_outputs: array<u32>;
var<private> probe_record: u32;
fn input(i: u32) -> u32 {{ return probe_inputs[probe_record * {input_words}u + i]; }}
fn input_f32(i: u32) -> f32 {{ return bitcast<f32>(input(i)); }}
fn input_vec3(i: u32) -> vec3<f32> {{ return vec3<f32>(input_f32(i), input_f32(i + 1u), input_f32(i + 2u)); }}
fn output(i: u32, word: u32) {{ probe_outputs[probe_record * {output_words}u + i] = word; }}
fn output_f32(i: u32, x: f32) {{ output(i, bitcast<u32>(x)); }}
fn output_vec3(i: u32, v: vec3<f32>) {{ output_f32(i, v.x); output_f32(i + 1u, v.y); output_f32(i + 2u, v.z); }}
fn probe() {{ {body} }}
@compute @workgroup_size({WORKGROUP})
fn probe_main(@builtin(global_invocation_id) id: vec3<u32>) {{
    probe_record = id.x;
    if id.x < {records}u {{ probe(); }}
}}
",
            prelude = self.prelude,
            body = self.body,
            input_words = self.input_words,
            output_words = self.output_words,
        )
    }
}

#[cfg(test)]
mod tests;
