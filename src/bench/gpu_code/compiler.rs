//! A Vulkan driver's compiler, asked what it made of a kernel (VK_KHR_pipeline_executable_properties). No command is ever run, so that Mesa's
//! RADV can be asked about chips that are not there.

use std::ffi::{CStr, CString};

use ash::khr::pipeline_executable_properties as executable;
use ash::vk;

use crate::gpu::kernel::Binding;

/// A driver that cannot be asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum CompilerError {
    #[error("no Vulkan driver answers: {0}")]
    NoDriver(String),
    #[error(
        "{device} does not tell what its compiler makes of kernels (VK_KHR_pipeline_executable_properties); name a chip with --amd, which needs no card"
    )]
    Silent { device: String },
    #[error("{device} does not compile {entry_point}: {reason}")]
    Refused {
        device: String,
        entry_point: String,
        reason: String,
    },
}

/// One figure of a compiled kernel, by the name that the driver has for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistic {
    pub name: String,
    pub value: f64,
}

/// An opened device that is only compiled for.
pub struct Compiler {
    /// "AMD RADV NAVI21".
    pub device_name: String,
    /// "radv Mesa 22.3.6".
    pub driver: String,
    device: ash::Device,
    executables: executable::Device,
    instance: ash::Instance,
    // Dropped last: it holds the loader's library.
    _entry: ash::Entry,
}

impl Compiler {
    /// The first device of the Vulkan loader.
    ///
    /// # Errors
    /// [`CompilerError::NoDriver`] or [`CompilerError::Silent`].
    pub fn open() -> Result<Self, CompilerError> {
        let none = |reason: String| CompilerError::NoDriver(reason);
        let failed = |result: vk::Result| CompilerError::NoDriver(result.to_string());
        // SAFETY: the loader is the system's own; nothing else of this process unloads it.
        let entry = unsafe { ash::Entry::load() }.map_err(|error| none(error.to_string()))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: `info` and what it points to outlive the call.
        let instance = unsafe { entry.create_instance(&info, None) }.map_err(failed)?;
        match Self::open_device(&instance) {
            Ok((device_name, driver, device)) => Ok(Self {
                executables: executable::Device::new(&instance, &device),
                device_name,
                driver,
                device,
                instance,
                _entry: entry,
            }),
            Err(error) => {
                // SAFETY: no device of the instance is left.
                unsafe { instance.destroy_instance(None) };
                Err(error)
            }
        }
    }

    fn open_device(
        instance: &ash::Instance,
    ) -> Result<(String, String, ash::Device), CompilerError> {
        let failed = |result: vk::Result| CompilerError::NoDriver(result.to_string());
        // SAFETY: the instance is alive.
        let devices = unsafe { instance.enumerate_physical_devices() }.map_err(failed)?;
        let physical = *devices
            .first()
            .ok_or_else(|| CompilerError::NoDriver("it has no device".to_owned()))?;
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
        // SAFETY: `physical` is the instance's; the chain outlives the call.
        unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
        let text = |name: Result<&CStr, _>| {
            name.map_or_else(
                |_| String::new(),
                |name: &CStr| name.to_string_lossy().into_owned(),
            )
        };
        let device_name = text(properties.properties.device_name_as_c_str());
        let driver = format!(
            "{} {}",
            text(driver.driver_name_as_c_str()),
            text(driver.driver_info_as_c_str())
        );
        // SAFETY: as above.
        let extensions =
            unsafe { instance.enumerate_device_extension_properties(physical) }.map_err(failed)?;
        let offers = |name: &CStr| {
            (extensions.iter()).any(|extension| extension.extension_name_as_c_str() == Ok(name))
        };
        if !offers(executable::NAME) {
            return Err(CompilerError::Silent {
                device: device_name,
            });
        }
        let mut names = vec![executable::NAME.as_ptr()];
        let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
        if offers(ash::ext::robustness2::NAME) {
            names.push(ash::ext::robustness2::NAME.as_ptr());
            robustness = robustness.robust_buffer_access2(true);
        }
        let mut statistics = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
            .pipeline_executable_info(true);
        let mut memory_model =
            vk::PhysicalDeviceVulkanMemoryModelFeatures::default().vulkan_memory_model(true);
        let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
        let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names)
            .enabled_features(&features)
            .push_next(&mut statistics)
            .push_next(&mut robustness)
            .push_next(&mut memory_model);
        // SAFETY: `info` and what it points to outlive the call.
        let device = unsafe { instance.create_device(physical, &info, None) }.map_err(failed)?;
        Ok((device_name, driver, device))
    }

    /// What the driver says of `entry_point` of `spirv`, which binds `bindings`.
    ///
    /// # Errors
    /// [`CompilerError::Refused`].
    pub fn statistics(
        &self,
        spirv: &[u32],
        entry_point: &str,
        bindings: &[Binding],
    ) -> Result<Vec<Statistic>, CompilerError> {
        let mut made = Made::default();
        // SAFETY: what is made is destroyed once, below; SPIR-V and bindings are those of validated code.
        let statistics = unsafe { self.compile(spirv, entry_point, bindings, &mut made) };
        // SAFETY: nothing was submitted, so nothing is in use.
        unsafe { made.destroy(&self.device) };
        statistics.map_err(|result| CompilerError::Refused {
            device: self.device_name.clone(),
            entry_point: entry_point.to_owned(),
            reason: result.to_string(),
        })
    }

    /// # Safety
    /// `spirv` must be valid and bind no more than `bindings`; the caller destroys what was `made`, whatever the outcome.
    unsafe fn compile(
        &self,
        spirv: &[u32],
        entry_point: &str,
        bindings: &[Binding],
        made: &mut Made,
    ) -> Result<Vec<Statistic>, vk::Result> {
        let device = &self.device;
        let groups = bindings.iter().map(|b| b.group + 1).max().unwrap_or(0);
        for group in 0..groups {
            let entries: Vec<_> = (bindings.iter())
                .filter(|binding| binding.group == group)
                .map(|binding| {
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(binding.binding)
                        .descriptor_count(1)
                        .descriptor_type(if binding.uniform {
                            vk::DescriptorType::UNIFORM_BUFFER
                        } else {
                            vk::DescriptorType::STORAGE_BUFFER
                        })
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&entries);
            made.sets
                .push(unsafe { device.create_descriptor_set_layout(&info, None) }?);
        }
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&made.sets);
        made.layout = unsafe { device.create_pipeline_layout(&info, None) }?;
        let info = vk::ShaderModuleCreateInfo::default().code(spirv);
        made.module = unsafe { device.create_shader_module(&info, None) }?;
        let name = CString::new(entry_point).map_err(|_| vk::Result::ERROR_UNKNOWN)?;
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(made.module)
            .name(&name);
        let info = vk::ComputePipelineCreateInfo::default()
            .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
            .stage(stage)
            .layout(made.layout);
        let pipelines =
            unsafe { device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        made.pipeline = pipelines.map_err(|(_, result)| result)?[0];
        let pipeline = vk::PipelineExecutableInfoKHR::default().pipeline(made.pipeline);
        let statistics = unsafe {
            self.executables
                .get_pipeline_executable_statistics(&pipeline)
        }?;
        Ok(statistics.iter().map(statistic).collect())
    }
}

impl Drop for Compiler {
    fn drop(&mut self) {
        // SAFETY: nothing made of either is left, and neither is used again.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// What compiling one kernel has made so far.
#[derive(Default)]
struct Made {
    sets: Vec<vk::DescriptorSetLayout>,
    layout: vk::PipelineLayout,
    module: vk::ShaderModule,
    pipeline: vk::Pipeline,
}

impl Made {
    /// # Safety
    /// All of it is `device`'s and out of use. What was not made is null, which Vulkan passes over.
    unsafe fn destroy(self, device: &ash::Device) {
        unsafe {
            device.destroy_pipeline(self.pipeline, None);
            device.destroy_shader_module(self.module, None);
            device.destroy_pipeline_layout(self.layout, None);
            for set in self.sets {
                device.destroy_descriptor_set_layout(set, None);
            }
        }
    }
}

fn statistic(raw: &vk::PipelineExecutableStatisticKHR<'_>) -> Statistic {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    let name = raw.name_as_c_str().map_or_else(
        |_| String::new(),
        |name| name.to_string_lossy().into_owned(),
    );
    // SAFETY: the field is read that `format` names.
    let value = unsafe {
        match raw.format {
            Format::BOOL32 => f64::from(raw.value.b32),
            Format::INT64 => raw.value.i64 as f64,
            Format::UINT64 => raw.value.u64 as f64,
            _ => raw.value.f64,
        }
    };
    Statistic { name, value }
}
