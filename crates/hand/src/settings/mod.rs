//! How the settings and names that people write are read, and refused in plain words.

mod did_you_mean;
mod from_map;
mod name;
mod plain_words;
mod range;
mod whole_list;

pub use did_you_mean::{closest, did_you_mean};
pub use from_map::FromMap;
pub use name::why_no_name;
pub use plain_words::plain_words;
pub use range::{RangeError, check_range};
pub use whole_list::{Whole, WholeList};
