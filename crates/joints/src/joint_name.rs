//! What can be the name of a joint.

use taxel_hand::why_no_name;

/// Why this cannot be the name of a joint beside others.
pub(crate) fn why_no_joint_name(name: &String, others: &[String]) -> Option<&'static str> {
    why_no_name(name).or(others.contains(name).then_some("that of another"))
}
