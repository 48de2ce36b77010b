//! How far off the publication's networks are after so many epochs, in its first repetition:
//!
//!     cargo run --release -p taxel-networks --example epochs -- DATA transposed|time CHECKPOINTS EPOCHS..

use std::ops::ControlFlow;
use std::path::Path;
use taxel_forearm::{Errors, Session, splits};
use taxel_networks::{Plan, Reading, run};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [data, reading, checkpoints, stops @ ..] = &args[..] else {
        return Err(
            "give DATA, transposed or time, a folder for CHECKPOINTS, and EPOCHS to stop at, ascending"
                .into(),
        );
    };
    let reading = match reading.as_str() {
        "transposed" => Reading::Transposed,
        "time" => Reading::Time,
        other => return Err(format!("{other:?} is no reading; give transposed or time").into()),
    };
    std::fs::create_dir_all(checkpoints)?;
    let session = Session::open(Path::new(data))?;
    // The first repetition is the same however many follow.
    let split = &splits(&session, 1, 1)[0];
    for stop in stops {
        let plan = Plan {
            reading,
            epochs: Some(stop.parse()?),
            folder: Some(checkpoints.into()),
            seed: 1,
        };
        for trained in run(&session, split, 0, &plan, &mut |_| ControlFlow::Continue(()))? {
            let errors = Errors::of(&trained.judged).ok_or("there is nothing to judge")?;
            println!(
                "{} after {} epochs, {:.1} s each: RMSE {:.2} (mean over places), {:.2} (squeezes); MAE {:.2}, {:.2}",
                trained.stage.kind,
                trained.epochs,
                trained.train_s / trained.epochs as f64,
                errors.macro_rmse,
                errors.pooled_rmse,
                errors.macro_mae,
                errors.pooled_mae,
            );
        }
    }
    Ok(())
}
