//! What a configuration would run, for people and programs.

use crate::Config;
use serde::Serialize;
use taxel_hand::plural;

impl Config {
    /// The hand, its buses and its joints in a few lines, and what of them does not fit together.
    pub fn summary(&self) -> String {
        let layout = &self.layout;
        let mut text = format!(
            "{}: {}, {}, {}x{} image\n",
            layout.name,
            plural(layout.modules.len(), "module"),
            plural(layout.len(), "taxel"),
            layout.height,
            layout.width
        );
        for (bus, source) in layout.buses.iter().zip(&self.sources) {
            text += &format!("  {bus}: {source}\n");
        }
        if let Some(joints) = &self.joints {
            text += &format!(
                "  {}: {}\n",
                plural(joints.joint_names().len(), "joint"),
                joints.source
            );
        }
        if let Some(sentence) = self.boardless_modules() {
            text += &format!("  {sentence}\n");
        }
        if let Some(sentence) = self.unread_joints() {
            text += &format!("  {sentence}\n");
        }
        text
    }

    /// Every value in force, as the tables of a configuration file; not `layout`, of which the name alone is known.
    pub fn in_force(&self) -> toml::Table {
        fn table(value: impl Serialize) -> toml::Value {
            toml::Value::try_from(value).expect("numbers, texts and lists are TOML")
        }
        let buses = self.sources.iter().map(|source| {
            let source = toml::Value::from(source.to_string());
            toml::Value::Table(toml::Table::from_iter([("source".to_owned(), source)]))
        });
        let joints = self.joints.iter().map(|joints| ("joints", table(joints)));
        toml::Table::from_iter(
            [
                ("bus", toml::Value::Array(buses.collect())),
                ("tick", table(self.tick)),
                ("boards", table(&self.boards)),
                ("sweep", table(&self.sweep)),
                ("conditioning", table(&self.conditioning)),
                ("profile", table(self.profile.in_force())),
                ("profiles", table(self.profiles)),
                ("socket", table(&self.socket)),
                ("control", table(&self.control)),
                ("realtime", table(self.realtime)),
                ("can", table(self.can)),
            ]
            .into_iter()
            .chain(joints)
            .map(|(name, value)| (name.to_owned(), value)),
        )
    }
}
