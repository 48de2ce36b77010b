//! Files that hold a result, and frames and images as lines of text.

pub mod image_line;
pub mod image_output;
pub mod output_file;
pub mod raw_line;
