//! Joints of the layout that are read under another name, or not at all.

use crate::Config;
use taxel_hand::closest;

impl Config {
    /// What is to be said of joints that the layout's modules sit on and that `[joints]` has under
    /// no such name: whoever reads the images cannot tell how these modules move. `None` where there
    /// are none, or no joints are read.
    pub fn unread_joints(&self) -> Option<String> {
        let read = self.joints.as_ref()?.joint_names();
        let wanted = self.layout.joints();
        let is_free = |name: &&str| !wanted.contains(name);
        let free: Vec<&str> = read.iter().map(String::as_str).filter(is_free).collect();
        let unread: Vec<String> = (wanted.iter())
            .filter(|name| !read.iter().any(|read| read == *name))
            .map(|name| match closest(name, free.iter().copied()) {
                Some(near) => format!("`{name}` (there is `{near}`)"),
                None => format!("`{name}`"),
            })
            .collect();
        (!unread.is_empty()).then(|| {
            format!(
                "modules of layout {} sit on joints that [joints] does not read: {}; give them the same names in both",
                self.layout.name,
                unread.join(", ")
            )
        })
    }
}
