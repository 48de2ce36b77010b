//! The plots of docs/benchmarks.md, from what `tests/peers/run` has measured:
//! `cargo run -p taxel-plot --example benchmarks -- results.json docs/plots`.

use serde::Deserialize;
use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use taxel_plot::{Axis, Chart, Sheet};

#[derive(Deserialize)]
struct Results {
    recordings: Vec<Recording>,
    scaling: Vec<Scaling>,
    kernel_scaling: Vec<KernelScaling>,
    history: Vec<History>,
}

#[derive(Deserialize)]
struct Recording {
    name: String,
    eval: Eval,
    peers: Vec<Peer>,
}

#[derive(Deserialize)]
struct Eval {
    contacts_median: f64,
    methods: Vec<Method>,
}

#[derive(Deserialize)]
struct Method {
    name: String,
    compress_us: Quantiles,
    force_sse_ratio_p95: f64,
    position_sse_ratio_mean: Option<f64>,
    moved_px_mean: f64,
}

/// One that has no actuators has one time alone.
#[derive(Deserialize)]
struct Peer {
    name: String,
    both_us_p50: Option<f64>,
    force_sse_ratio_p95: f64,
    position_sse_ratio_mean: Option<f64>,
}

#[derive(Deserialize)]
struct Quantiles {
    p50: f64,
    max: f64,
}

#[derive(Deserialize)]
struct Scaling {
    taxels: u32,
    methods: Vec<(String, Quantiles)>,
}

impl Scaling {
    fn of(&self, method: &str) -> Option<(f64, &Quantiles)> {
        let (_, us) = self.methods.iter().find(|(name, _)| name == method)?;
        Some((f64::from(self.taxels), us))
    }
}

#[derive(Deserialize)]
struct KernelScaling {
    values: u32,
    kernels: HashMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct History {
    name: String,
    eval: Eval,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, results, folder] = &args[..] else {
        return Err("usage: benchmarks RESULTS.json DIR".into());
    };
    let results: Results = serde_json::from_str(&std::fs::read_to_string(results)?)?;
    std::fs::create_dir_all(folder)?;
    for (name, sheet) in [
        ("speed-against-error", speed_against_error(&results)),
        ("cost-against-taxels", cost_against_taxels(&results)),
        ("error-against-movement", error_against_movement(&results)),
    ] {
        std::fs::write(Path::new(folder).join(name).with_extension("svg"), sheet.svg()?)?;
    }
    Ok(())
}

/// A recording of many contacts, and a scene whose forces all differ.
fn speed_against_error(results: &Results) -> Sheet {
    let mut sheet = Sheet::new("Time of a frame and error, K_D = 8, K_A = 16")
        .columns(2)
        .panel_size(480, 340);
    let many = results.recordings.iter().find(|r| r.eval.contacts_median > 30.0);
    let scene = results.recordings.iter().filter(|r| r.name == "scene ball-grasp");
    for Recording { name, eval, peers } in many.into_iter().chain(scene) {
        let own = eval.methods.iter().map(|m| {
            let (force, place) = (m.force_sse_ratio_p95, m.position_sse_ratio_mean);
            (format!("taxeld {}", m.name), m.compress_us.p50, force, place)
        });
        let peers = peers.iter().filter_map(|p| {
            let (force, place) = (p.force_sse_ratio_p95, p.position_sse_ratio_mean);
            Some((p.name.clone(), p.both_us_p50?, force, place))
        });
        let time = || Axis::new("both stages of a frame, us (median)").log();
        let mut force = Chart::new(name, time(), Axis::new("force error / least there is, p95").log());
        let mut place = Chart::new(name, time(), Axis::new("position error / best of 64, mean"));
        for (name, us, of_force, of_place) in own.chain(peers) {
            force = force.points(&name, [(us, of_force)]);
            place = place.points(name, of_place.map(|of_place| (us, of_place)));
        }
        sheet = sheet.chart(force).chart(place);
    }
    sheet
}

fn cost_against_taxels(results: &Results) -> Sheet {
    let axes = |x: &str| (Axis::new(x).log(), Axis::new("us a frame").log());
    let (x, y) = axes("taxels");
    let mut both = Chart::new(
        "Both stages, every taxel in contact; line: 1 ms, a tick at 1 kHz",
        x,
        y,
    );
    for method in ["paper", "optimal"] {
        let of = |us: fn(&Quantiles) -> f64| {
            let sizes = results.scaling.iter();
            sizes.filter_map(move |s| s.of(method).map(|(n, of)| (n, us(of))))
        };
        let slowest = format!("{method}, slowest frame");
        both = both
            .line(method, of(|us| us.p50))
            .points(method, of(|us| us.p50))
            .line(slowest, of(|us| us.max));
    }
    // Through the third size.
    let law = |n: f64| n * n.log2();
    if let Some((taxels, us)) = results.scaling.get(2).and_then(|s| s.of("optimal")) {
        let sizes = results.scaling.iter().map(|s| f64::from(s.taxels));
        both = both.line("n log n", sizes.map(|n| (n, us.p50 * law(n) / law(taxels))));
    }
    both = both.at_y("", 1000.0);
    let (x, y) = axes("values");
    let mut kernel = Chart::new("Force levels alone (8 levels, sorting included)", x, y);
    for name in ["Kmeans1d, after the last frame", "Kmeans1d, cold", "ckmeans"] {
        let points = || {
            let sizes = results.kernel_scaling.iter();
            sizes.filter_map(|s| Some((f64::from(s.values), s.kernels.get(name)?["p50_us"].as_f64()?)))
        };
        kernel = kernel.line(name, points()).points(name, points());
    }
    Sheet::new("Cost against the number of taxels")
        .columns(2)
        .panel_size(480, 400)
        .chart(both)
        .chart(kernel)
}

/// Each setting from its least value on, whose last is marked.
fn error_against_movement(results: &Results) -> Sheet {
    let mut sheet = Sheet::new("Error against movement")
        .columns(2)
        .panel_size(480, 340);
    for History { name, eval } in &results.history {
        let at = |m: &Method| Some((m.moved_px_mean, m.position_sse_ratio_mean?));
        let paper = eval.methods.iter().find(|m| m.name == "paper").and_then(at);
        let title = paper.map_or(name.clone(), |(moved, error)| {
            format!("{name} (paper: {moved:.2} px, {error:.3})")
        });
        let x = Axis::new("movement of an actuator, pixels a frame (mean)").from_zero();
        let mut chart = Chart::new(title, x, Axis::new("position error / best of 64, mean"));
        for setting in ["history", "jump_gain"] {
            let of_setting = |m: &&Method| {
                m.name
                    .split_once('=')
                    .is_some_and(|(key, _)| key == format!("optimal {setting}"))
            };
            let methods: Vec<&Method> = eval.methods.iter().filter(of_setting).collect();
            let points = || methods.iter().filter_map(|m| at(m));
            let values = methods.iter().filter_map(|m| m.name.split_once('='));
            let values: Vec<&str> = values.map(|(_, value)| value).collect();
            let (Some(first), Some(last)) = (values.first(), values.last()) else {
                continue;
            };
            let curve = format!("{setting}, from {first}");
            chart = chart.line(&curve, points()).points(curve, points());
            chart = chart.points(format!("{setting} {last}"), points().next_back());
        }
        sheet = sheet.chart(chart);
    }
    sheet
}
