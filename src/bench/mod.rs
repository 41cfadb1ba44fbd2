//! Measurement: what `mixray bench` does.
//!
//! [`measure`] renders methods in turns against a [`Truth`] that [`reference`] makes; [`Report`] keeps the figures, and the other modules
//! make tables, plots and a page of it or compare it with an earlier one. [`grow`] finds how the cost grows with the work, [`gpu_time`] where a
//! GPU's time goes, [`gpu_frames`] where the host's, [`kernel_code`] what its compiler makes of the kernels, and [`stress`] what breaks renderers.

mod against;
mod chart;
mod columns;
mod docs;
mod errors;
mod fit;
mod goal;
mod gpu_code;
mod gpu_frame;
mod gpu_time;
mod growth;
mod machine;
mod measure;
mod page;
mod paper;
mod pictures;
mod plot;
mod record;
mod reference;
mod scenes;
mod shrink;
pub mod stress;
mod table;

pub use against::{Change, Verdict, against};
pub use docs::replace_section;
pub use errors::{Errors, Figures, Truth};
pub use fit::{Fit, Reach, cost_to_reach, log_log_fit, log_log_slope};
pub use goal::{Aim, Goal};
pub use gpu_code::{
    Compiler, CompilerError, GpuCodeError, KernelCode, Variant, further_variants,
    gpu_code_markdown, gpu_code_text, kernel_code, variant_of,
};
pub use gpu_frame::{GpuFrame, gpu_frame_markdown, gpu_frame_text, gpu_frames};
pub use gpu_time::{GpuTime, gpu_time, gpu_time_markdown, gpu_time_text};
pub use growth::{Curve, Law, Point, grow, growth_csv, growth_markdown, growth_plot, growth_text};
pub use machine::{Gpu, Machine};
pub use measure::{MeasureError, Plan, Shot, measure, rmse_of};
pub use page::page;
pub use paper::{
    PAPER_SCENE, PaperRow, paper_markdown, paper_rays_per_pixel, paper_rows, paper_text,
};
pub use pictures::{difference_png, picture_png};
pub use plot::{Axis, Plot, PlotError, plots};
pub use record::{FORMAT, Method, ReferenceNote, Report, Row, Run, Target};
pub use reference::{Reference, ReferenceError, ReferenceGoal, Source, reference};
pub use shrink::shrink;
pub use table::{csv, markdown, text};
