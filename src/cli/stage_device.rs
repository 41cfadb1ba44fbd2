//! Where a stage runs that is asked for without a render.

use std::sync::Arc;

use clap::Args;
use clap::builder::PossibleValuesParser;

use super::Failure;
use crate::gpu::{AdapterChoice, GpuDevice};
use crate::stages::GpuStages;

#[derive(Debug, Args)]
pub(super) struct StageDevice {
    /// Where to compute: a single picture is done on the CPU before a graphics device is opened
    #[arg(long, default_value = "cpu", value_parser = PossibleValuesParser::new(["cpu", "gpu"]))]
    backend: String,
}

impl StageDevice {
    /// The graphics device, if one was asked for.
    pub(super) fn open(&self) -> Result<Option<GpuStages>, Failure> {
        if self.backend == "cpu" {
            return Ok(None);
        }
        let gpu = GpuDevice::open(AdapterChoice::Any)?;
        Ok(Some(GpuStages::new(Arc::new(gpu))))
    }
}
