//! Results as files: one output format a file.

pub mod atomic;
pub mod bench;
pub mod chart;
pub mod chart_plot;
pub mod chart_resume;
pub mod chart_table;
pub mod exr;
pub mod exr_read;
pub mod exr_references;
pub mod heatmap;
pub mod manifest;
pub mod plot;
pub mod png;
pub mod record;
pub mod scaling;
pub mod scaling_plot;
pub mod stability;
pub mod trace;
