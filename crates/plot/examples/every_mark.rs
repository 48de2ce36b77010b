//! Every mark once: `cargo run -p taxel-plot --example every_mark > marks.svg`.

use taxel_plot::{Axis, Chart, Picture, PlotError, Sheet};

fn main() -> Result<(), PlotError> {
    print!("{}", sheet().svg()?);
    Ok(())
}

fn sheet() -> Sheet {
    let time = || (0..200).map(|n| f64::from(n) / 50.0);
    let felt = |t: f64| 900.0 * (t - 1.0).clamp(0.0, 1.0) * (4.0 - t).clamp(0.0, 1.0);
    let lines = Chart::new(
        "Lines and bands",
        Axis::new("time, s"),
        Axis::new("force, counts"),
    )
    .band("felt", time().map(|t| (t, felt(t) * 0.8, felt(t) * 1.2)))
    .line("felt", time().map(|t| (t, felt(t))))
    .line("shown", time().map(|t| (t, (felt(t) / 300.0).round() * 300.0)))
    .at_y("threshold", 60.0);
    let cloud = |x: f64, y: f64, slant: f64| {
        (0..12).map(move |n| {
            let (s, c) = (f64::from(n) * 2.4).sin_cos();
            let r = f64::from(n % 4 + 1) / 4.0;
            (x + r * c, y + slant * r * c + 0.3 * r * s)
        })
    };
    let mut classes = Chart::new("Classes", Axis::new("component 1"), Axis::new("component 2"));
    for (name, x, y, slant) in [
        ("soft", 0.0, 0.0, 1.0),
        ("hard", 3.0, 1.0, -0.5),
        ("both", 2.0, 3.5, 0.0),
    ] {
        classes = classes
            .ellipse(name, cloud(x, y, slant))
            .points(name, cloud(x, y, slant));
    }
    let names = ["index", "middle", "ring", "thumb"];
    let bars = Chart::new("Bars", Axis::of_names("finger", names), Axis::new("share, %"))
        .bars_within(
            "felt",
            [
                (40.0, 35.0, 45.0),
                (30.0, 20.0, 33.0),
                (20.0, 18.0, 22.0),
                (10.0, 5.0, 11.0),
            ],
        )
        .bars("shown", [35.0, 32.0, 25.0, 8.0]);
    let sample = |n: u32| {
        (0..40)
            .map(|k| f64::from((k * k + 7 * n) % (20 + n)) + f64::from(n))
            .collect()
    };
    let boxes = Chart::new("Boxes", Axis::of_names("", names), Axis::new("error, mm"))
        .boxes("tactile", (1..5).map(sample))
        .boxes("kinesthetic", (3..7).map(sample));
    let log = Chart::new("Log axes", Axis::new("taxels").log(), Axis::new("time, us").log())
        .line(
            "optimal",
            (0..10).map(|n| (16.0 * 2f64.powi(n), 0.4 * 2.1f64.powi(n))),
        )
        .line(
            "paper",
            (0..10).map(|n| (16.0 * 2f64.powi(n), 8.0 * 2.0f64.powi(n))),
        );
    let grey = (0..256).map(|n| if n % 37 == 0 { (n % 8 * 32) as u8 } else { 0 });
    let grey = Picture::grey("A tactile image", 16, grey).caption("8 levels, 7 actuators");
    let rgb = (0..256).map(|n| (n % 16 < 12 || n < 192).then_some([n as u8, 128, 255 - n as u8]));
    let rgb = Picture::rgb("A frame as colours", 16, rgb);
    let confusion = [0.95, 0.05, 0.0, 0.1, 0.8, 0.1, f64::NAN, 0.2, 0.8];
    let confusion = Picture::heat("Confusion", 3, confusion)
        .row_names(["soft", "hard", "both"])
        .column_names(["soft", "hard", "both"])
        .span(0.0, 1.0);
    Sheet::new("Every mark <once> & for all")
        .columns(3)
        .panel_size(380, 260)
        .chart(lines)
        .chart(classes)
        .chart(bars)
        .chart(boxes)
        .chart(log)
        .picture(grey)
        .picture(rgb)
        .picture(confusion)
}
