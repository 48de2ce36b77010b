//! Recordings as commands take them, what is told of them, and frames and marks in files.

pub(crate) mod assumed;
mod boards;
pub(crate) mod frame_output;
pub(crate) mod held_to_the_end;
pub(crate) mod implausible_times;
pub(crate) mod input;
pub(crate) mod magnitudes;
pub(crate) mod marks_file;
pub(crate) mod movement;
pub(crate) mod offline;
pub(crate) mod out_of_use;
pub(crate) mod own_clock;

use taxel_record::Recording;

/// Says that the joint angles of a recording do not become CAN traffic.
pub(crate) fn tell_joints(recording: &Recording) {
    let joints = recording.joints(0).len();
    if joints > 0 {
        remark!(
            "taxel: {}: its {joints} joint angles are left out; boards send counts",
            recording.name()
        );
    }
}
