//! Writes a scene as a candump log: `cargo run -p taxel-sim --example scene_to_log -- SCENE
//! [LAYOUT] > file.log`.

use std::io::BufWriter;
use taxel_can::LogWriter;
use taxel_sim::{Scene, Simulator};
use taxel_skin::Layout;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = arguments.next().ok_or("usage: scene_to_log SCENE [LAYOUT]")?;
    let scene = Scene::resolve(&scene)?;
    let layout = Layout::resolve(&arguments.next().unwrap_or_else(|| scene.layout().into()))?;
    let mut hand = Simulator::new(&scene, &layout, scene.seed())?;
    hand.start_all();
    let mut log = LogWriter::new(BufWriter::new(std::io::stdout().lock()));
    let mut frames = Vec::new();
    while let Some(next_ns) = hand.next_at_ns() {
        hand.advance(next_ns + 100_000_000, &mut frames);
        for (bus, received) in frames.drain(..) {
            log.write(received.t_ns, &layout.buses[bus as usize], &received.frame)?;
        }
    }
    log.flush()?;
    Ok(())
}
