//! Hands and scenes for tests.

use taxel_can::{CanFrame, Received};
use taxel_sim::{Scene, Simulator};
use taxel_skin::Layout;

/// Modules of 16 taxels with these addresses on one bus.
pub(crate) fn boards(protocol: &str, addresses: &[u8]) -> Layout {
    let mut text = format!(
        "name = \"test\"\nimage = {{ width = {}, height = 4 }}\nbuses = [\"can0\"]\n",
        4 * addresses.len()
    );
    for (i, address) in addresses.iter().enumerate() {
        text += &format!(
            "[[module]]\nname = \"m{address}\"\npart = \"p\"\nbus = \"can0\"\nboard = {address}\n\
             protocol = \"{protocol}\"\nat = [{}, 0]\n",
            4 * i
        );
    }
    Layout::parse(&text, "test.toml").unwrap()
}

/// A scene of `seconds` with more text after the head.
pub(crate) fn scene(seconds: u32, more: &str) -> Scene {
    Scene::parse(
        &format!("name = \"test\"\nseconds = {seconds}\n{more}"),
        "test.toml",
    )
    .unwrap()
}

/// A simulator of a one-bus hand, with its frames up to a time.
pub(crate) struct Bench {
    pub(crate) sim: Simulator,
    pub(crate) frames: Vec<Received>,
}

impl Bench {
    pub(crate) fn new(scene: &Scene, layout: &Layout) -> Self {
        Self {
            sim: Simulator::new(scene, layout, 1).unwrap(),
            frames: Vec::new(),
        }
    }

    pub(crate) fn streaming(scene: &Scene, layout: &Layout) -> Self {
        let mut bench = Self::new(scene, layout);
        bench.sim.start_all();
        bench
    }

    /// What came up to this time since the last call.
    pub(crate) fn until_ms(&mut self, ms: u64) -> &[Received] {
        let mut frames = Vec::new();
        self.sim.advance(ms * 1_000_000, &mut frames);
        self.frames = frames.into_iter().map(|(_, f)| f).collect();
        &self.frames
    }

    pub(crate) fn command(&mut self, ms: u64, id: u16, data: &[u8]) {
        let frame = CanFrame::standard(id, data).unwrap();
        self.sim.command(0, &frame, ms * 1_000_000).unwrap();
    }
}

/// Taxel frames of one board among these.
pub(crate) fn of_board(layout: &Layout, frames: &[Received], board: u8) -> usize {
    let protocol = layout.wiring[0].protocol;
    let ids: Vec<u16> = (0..16).filter_map(|k| protocol.can_id(board, k)).collect();
    let taxel =
        |f: &&Received| f.frame.dlc() == 8 && f.frame.standard_id().is_some_and(|id| ids.contains(&id));
    frames.iter().filter(taxel).count()
}
