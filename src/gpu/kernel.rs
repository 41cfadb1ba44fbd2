//! A compute pipeline made from composed WGSL; its bind group layouts are read off the code itself.

use std::borrow::Cow;
use std::collections::HashSet;

use wgpu::naga;

use super::compose::item_name;
use super::{GpuDevice, GpuError};

/// One buffer that a kernel binds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    pub group: u32,
    pub binding: u32,
    /// As its shader file declares it.
    pub name: String,
    pub uniform: bool,
    pub read_only: bool,
    /// Bytes of the uniform block, or of one element of the array.
    pub stride: u32,
}

/// The buffers that `wgsl` declares, by group and binding.
///
/// # Errors
/// What naga finds wrong, with the line.
pub fn reflect_bindings(wgsl: &str) -> Result<Vec<Binding>, String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|error| error.emit_to_string(wgsl))?;
    let mut layouter = naga::proc::Layouter::default();
    layouter
        .update(module.to_ctx())
        .map_err(|error| error.to_string())?;
    let mut bindings: Vec<Binding> = module
        .global_variables
        .iter()
        .filter_map(|(_, variable)| {
            let at = variable.binding?;
            let (uniform, read_only) = match variable.space {
                naga::AddressSpace::Uniform => (true, true),
                naga::AddressSpace::Storage { access } => {
                    (false, !access.contains(naga::StorageAccess::STORE))
                }
                _ => return None,
            };
            let stride = match module.types[variable.ty].inner {
                naga::TypeInner::Array { stride, .. } => stride,
                _ => layouter[variable.ty].size,
            };
            Some(Binding {
                group: at.group,
                binding: at.binding,
                name: item_name(variable.name.as_deref().unwrap_or_default()).to_owned(),
                uniform,
                read_only,
                stride,
            })
        })
        .collect();
    bindings.sort_by_key(|binding| (binding.group, binding.binding));
    Ok(bindings)
}

/// How buffers of uniforms are used: on software devices they are read as storage (see [`for_device`]).
pub const UNIFORM_USAGE: wgpu::BufferUsages = wgpu::BufferUsages::UNIFORM
    .union(wgpu::BufferUsages::STORAGE)
    .union(wgpu::BufferUsages::COPY_DST);

/// Mesa's software driver compiles a kernel anew, before it is bound, for the values of the uniforms that its branches depend on, and keeps every
/// copy. From storage it takes values as they come; both address spaces lay structures out alike.
fn for_device<'a>(gpu: &GpuDevice, wgsl: &'a str) -> Cow<'a, str> {
    match gpu.info.device_type {
        wgpu::DeviceType::Cpu => wgsl.replace("var<uniform>", "var<storage, read>").into(),
        _ => wgsl.into(),
    }
}

/// A compiled entry point.
pub struct Kernel {
    entry_point: String,
    pipeline: wgpu::ComputePipeline,
    layouts: Vec<Option<wgpu::BindGroupLayout>>,
    bindings: Vec<Binding>,
}

/// A kernel's buffers, ready to be set: group index and bind group.
pub type BindGroups = Vec<(u32, wgpu::BindGroup)>;

impl Kernel {
    /// Compiles `entry_point` of `wgsl`.
    ///
    /// # Errors
    /// [`GpuError::Shader`], or [`GpuError::Limit`] if the adapter allows a kernel fewer buffers than this one reads.
    pub fn new(gpu: &GpuDevice, entry_point: &str, wgsl: &str) -> Result<Self, GpuError> {
        let shader_error = |message: String| GpuError::Shader {
            entry_point: entry_point.to_owned(),
            message,
        };
        let wgsl = &*for_device(gpu, wgsl);
        let bindings = reflect_bindings(wgsl).map_err(shader_error)?;
        let mut names = HashSet::new();
        if let Some(twice) = bindings.iter().find(|b| !names.insert(b.name.as_str())) {
            return Err(shader_error(format!(
                "two buffers are called {}",
                twice.name
            )));
        }
        let storage = bindings.iter().filter(|binding| !binding.uniform).count();
        let allowed = gpu.limits.max_storage_buffers_per_shader_stage;
        if storage > allowed as usize {
            return Err(GpuError::Limit {
                what: format!("kernel {entry_point}"),
                needed: format!("{storage} storage buffers"),
                available: allowed.to_string(),
                adapter: gpu.name(),
                advice: "render with --backend cpu",
            });
        }
        let group_count = bindings.iter().map(|b| b.group + 1).max().unwrap_or(0);
        let made = gpu.catching(|| {
            let layouts: Vec<Option<wgpu::BindGroupLayout>> = (0..group_count)
                .map(|group| group_layout(gpu, &bindings, group))
                .collect();
            let module = gpu
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(entry_point),
                    source: wgpu::ShaderSource::Wgsl(wgsl.into()),
                });
            let layout = gpu
                .device
                .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                    label: Some(entry_point),
                    bind_group_layouts: &layouts.iter().map(Option::as_ref).collect::<Vec<_>>(),
                    immediate_size: 0,
                });
            let pipeline = gpu
                .device
                .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(entry_point),
                    layout: Some(&layout),
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        // Every kernel writes its workgroup memory before it reads it.
                        zero_initialize_workgroup_memory: false,
                        ..Default::default()
                    },
                    cache: None,
                });
            (layouts, pipeline)
        });
        let (layouts, pipeline) = made.map_err(|error| shader_error(error.to_string()))?;
        Ok(Self {
            entry_point: entry_point.to_owned(),
            pipeline,
            layouts,
            bindings,
        })
    }

    pub fn bindings(&self) -> &[Binding] {
        &self.bindings
    }

    /// Bind groups with the buffers that `resource` gives for the names of their declarations.
    ///
    /// # Errors
    /// [`GpuError::Unbound`] if it gives none for a buffer that the kernel reads.
    pub fn bind<'a>(
        &self,
        gpu: &GpuDevice,
        resource: impl Fn(&str) -> Option<&'a wgpu::Buffer>,
    ) -> Result<BindGroups, GpuError> {
        let mut groups = Vec::new();
        for (group, layout) in (0..).zip(&self.layouts) {
            let Some(layout) = layout else { continue };
            let mut entries = Vec::new();
            for binding in self.bindings.iter().filter(|b| b.group == group) {
                let buffer = resource(&binding.name).ok_or_else(|| GpuError::Unbound {
                    entry_point: self.entry_point.clone(),
                    name: binding.name.clone(),
                })?;
                entries.push(wgpu::BindGroupEntry {
                    binding: binding.binding,
                    resource: buffer.as_entire_binding(),
                });
            }
            let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(&self.entry_point),
                layout,
                entries: &entries,
            });
            groups.push((group, bind_group));
        }
        Ok(groups)
    }

    /// Sets pipeline and buffers; a dispatch follows.
    pub fn set(&self, pass: &mut wgpu::ComputePass<'_>, groups: &BindGroups) {
        pass.set_pipeline(&self.pipeline);
        for (group, bind_group) in groups {
            pass.set_bind_group(*group, bind_group, &[]);
        }
    }
}

fn group_layout(
    gpu: &GpuDevice,
    bindings: &[Binding],
    group: u32,
) -> Option<wgpu::BindGroupLayout> {
    let entries: Vec<wgpu::BindGroupLayoutEntry> = bindings
        .iter()
        .filter(|binding| binding.group == group)
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding: binding.binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: if binding.uniform {
                    wgpu::BufferBindingType::Uniform
                } else {
                    wgpu::BufferBindingType::Storage {
                        read_only: binding.read_only,
                    }
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        })
        .collect();
    (!entries.is_empty()).then(|| {
        gpu.device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: None,
                entries: &entries,
            })
    })
}
