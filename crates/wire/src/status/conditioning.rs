//! What conditioning made of the samples.

use super::report::report;
use serde::{Deserialize, Serialize};

report! {
    /// What conditioning made of the counts of all taxels. A sample may count under several.
    ConditioningStatus {
        /// Samples taken in.
        samples: u64,
        /// Samples held back until the next one confirms them, since an axis jumped.
        held: u64,
        /// Glitches: samples held back, and not confirmed.
        glitches: u64,
        /// Samples in which an axis wrapped around modulo 65,536.
        wraps: u64,
        /// Samples with a step of about half a turn of 65,536, which was taken to go back towards the baseline.
        ambiguous_steps: u64,
        /// Samples with which a taxel came to rest a turn or more away from its baseline, and was put back.
        corrected_turns: u64,
        /// Samples with which a taxel's turns had run away beyond any motion, and began anew.
        runaways: u64,
        /// Samples not used, since they read 0 or 65535 on every axis.
        dead: u64,
        /// Samples not used, since their status byte reports an error.
        status_errors: u64,
        /// How often the baseline of a taxel had drifted to its limit and followed no further.
        drift_limited: u64,
    }
}
