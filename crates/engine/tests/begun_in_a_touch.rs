//! A daemon that starts while the hand is being touched: whatever the baseline is worth then, no board that has spoken
//! is taken for silent or told to start again, during the touch, after it or in the next one.

use std::collections::BTreeMap;
use taxel_can::Received;
use taxel_engine::{Engine, EngineConfig, TickMode};
use taxel_sim::{Scene, Simulator, with_stand_in_boards};
use taxel_skin::{BoardState, BoardsMode, Layout};

const MS: u64 = 1_000_000;
/// Every module is held from the beginning, let go, pressed again and let go.
const HELD: &str = "name = \"held\"\nseconds = 9.0\n[[contact]]\nshape = \"bump\"\non = [\"all\"]\nat_share = [0.5, 0.5]\n\
                    radius_share = 0.6\nforce_n = [[0.0, 3.0], [4.5, 3.0], [4.8, 0.0], [6.0, 0.0], [6.3, 3.0], \
                    [7.5, 3.0], [7.8, 0.0]]\n";
/// When the engine starts, in the touch.
const BEGIN_NS: u64 = 1_237 * MS;

/// The states that each board has gone through, and how often it was told to start anew.
fn lives(
    layout: &Layout,
    config: EngineConfig,
    is_streaming: bool,
) -> BTreeMap<String, (Vec<BoardState>, u64)> {
    let scene = Scene::parse(HELD, "held.toml").unwrap();
    let mut hand = Simulator::new(&scene, layout, 3).unwrap();
    if is_streaming {
        hand.start_all();
    }
    let mut frames: Vec<(u8, Received)> = Vec::new();
    hand.advance(BEGIN_NS, &mut frames);
    let mut engine = Engine::new(&config, BEGIN_NS).unwrap();
    let mut lives = BTreeMap::new();
    let mut now_ns = BEGIN_NS;
    while now_ns < scene.length_ns() {
        for bus in 0..layout.buses.len() as u8 {
            engine.handle_link(bus, true, true, now_ns);
        }
        while let Some(command) = engine.poll_command(now_ns) {
            if hand.command(command.bus, &command.frame, now_ns).is_err() {
                engine.handle_unsent(&command, now_ns);
            }
        }
        now_ns += MS;
        frames.clear();
        hand.advance(now_ns, &mut frames);
        for (bus, received) in &frames {
            engine.handle_frame(*bus, received);
            engine.drain(&mut |_| {});
        }
        engine.handle_time(now_ns);
        engine.drain(&mut |_| {});
        for (number, module) in layout.modules.iter().enumerate() {
            let board = engine.board(number as u16);
            let (states, restarts): &mut (Vec<BoardState>, u64) =
                lives.entry(module.name.clone()).or_default();
            // Until its pace is known, a board is taken for silent between its first sweeps, and nobody is told.
            if board.period_ns.is_some() && states.last() != Some(&board.state) {
                states.push(board.state);
            }
            *restarts = board.restarts;
        }
    }
    lives
}

#[test]
fn boards_of_every_kind_speak_on_where_a_daemon_starts_in_the_middle_of_a_touch() {
    for name in Layout::builtin_names() {
        let layout = with_stand_in_boards(&Layout::builtin(name).unwrap()).unwrap();
        for (is_streaming, mode, tick) in [
            (false, BoardsMode::FreeRunning, TickMode::Timer),
            (true, BoardsMode::FreeRunning, TickMode::Sweep),
            (true, BoardsMode::Triggered, TickMode::Timer),
        ] {
            let mut config = EngineConfig::new(layout.clone());
            config.tick.mode = tick;
            config.boards.mode = mode;
            for (module, (states, restarts)) in lives(&layout, config, is_streaming) {
                let case = format!("{name}, {module}, {mode:?}, streaming {is_streaming}: {states:?}");
                let spoke = states.iter().position(|state| *state == BoardState::Streaming);
                let since = spoke.map_or(&[][..], |first| &states[first..]);
                assert_eq!((since, restarts), (&[BoardState::Streaming][..], 0), "{case}");
            }
        }
    }
}
