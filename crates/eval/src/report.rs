//! What `taxel eval --json` prints: the keys that others script against, and more.

use crate::contact_truth::ContactTruth;
use crate::cost::Cost;
use crate::judge::Errors;
use crate::method::Method;
use serde::Serialize;

/// Every method on the same frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EvalReport {
    /// The recording.
    pub input: String,
    /// Frames in it.
    pub frames: usize,
    /// Taxels of the hand.
    pub taxels: usize,
    /// Frames with at least one contact.
    pub contact_frames: usize,
    /// Median number of contacts in those.
    pub contacts_median: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// `K_D`.
    pub levels: u16,
    /// `K_A`.
    pub actuators: u16,
    /// Bits per second of the raw counts, 16 bits on three axes; of one 16-bit magnitude per taxel
    /// where there are no counts.
    pub raw_bits_per_s: f64,
    /// k-means++ runs per frame that the position ratio is against.
    pub restarts: u32,
    /// Share of the actuators that must jump, whatever the method, if no frame's position error is
    /// more than 1.08 times the best known: a lower bound, from the contacts alone.
    pub jump_bound_fraction: f64,
    /// What places and jumps are measured in: `px`, or `mm` where actuators are placed on the hand.
    pub place_unit: String,
    /// A move beyond this is a jump.
    pub jump_distance: f64,
    /// Passes that times are medians of.
    pub passes: usize,
    /// The preset that frames were conditioned by, or closest to: `robust` or `paper`; absent where the recording
    /// holds magnitudes.
    pub conditioning: Option<String>,
    /// Whether a tick includes conditioning: not where the recording holds magnitudes.
    pub conditioning_timed: bool,
    /// Contacts against the scene's truth, if the input is a scene.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_truth: Option<ContactTruth>,
    /// The methods.
    pub methods: Vec<MethodReport>,
}

/// What compression of a skin of some size costs, every taxel in contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScalingReport {
    /// Taxels, all of them in contact.
    pub taxels: usize,
    /// Time of both stages per method, microseconds: over frames, each frame's the least of a few passes.
    pub methods: Vec<(String, crate::Quantiles)>,
}

/// What one method does to the frames, and what it costs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodReport {
    /// Its name.
    pub name: String,
    /// Whether its levels are fitted to each frame. Those that stay are optimal for no frame on purpose.
    pub levels_fitted: bool,
    /// Whether the display's actuators cannot move, so that how close they are to the contacts is not the method's doing.
    pub places_fixed: bool,
    /// Its errors.
    #[serde(flatten)]
    pub errors: Errors,
    /// Median time of a tick over frames, microseconds ([`Cost::tick_us`]).
    pub tick_us_p50: f64,
    /// 99 in 100 frames take no longer.
    pub tick_us_p99: f64,
    /// 999 in 1000 frames take no longer.
    pub tick_us_p999: f64,
    /// Allocations per tick after start; absent if not counted.
    pub allocations_per_tick: Option<f64>,
    /// Times in detail.
    #[serde(flatten)]
    pub cost: CostDetail,
}

/// The parts of [`Cost`] beyond the contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CostDetail {
    /// Conditioning alone.
    pub condition_us: crate::Quantiles,
    /// Compression alone.
    pub compress_us: crate::Quantiles,
    /// Every single tick of every pass.
    pub every_tick_us: crate::Quantiles,
}

impl MethodReport {
    /// Errors and cost of a method, together.
    pub fn new(method: &Method, errors: Errors, cost: Cost) -> Self {
        Self {
            name: method.name.clone(),
            levels_fitted: method.profile.fits_frames(),
            places_fixed: !method.profile.fixed.is_empty(),
            errors,
            tick_us_p50: cost.tick_us.p50,
            tick_us_p99: cost.tick_us.p99,
            tick_us_p999: cost.tick_us.p999,
            allocations_per_tick: cost.allocations_per_tick,
            cost: CostDetail {
                condition_us: cost.condition_us,
                compress_us: cost.compress_us,
                every_tick_us: cost.every_tick_us,
            },
        }
    }
}
