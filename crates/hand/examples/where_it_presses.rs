//! Where a hand is pressed: the strongest taxel of each module, and the place of its module on the finger.
//!
//!     cargo run -p taxel-hand --example where_it_presses

use taxel_hand::{ForceFrame, Geometry, GeometryError, Module, Pose, Taxel};

/// Two modules of two by two taxels beside each other in the image. Where the first sits on its
/// link is known.
fn two_fingers() -> Result<Geometry, GeometryError> {
    let module = |name: &str, part: &str, first_taxel, pose, joint: Option<&str>| Module {
        name: name.into(),
        part: part.into(),
        first_taxel,
        taxels: 4,
        pose,
        joint: joint.map(String::from),
    };
    let pose = Pose {
        position_mm: [0.0, 4.0, 25.0],
        orientation: [1.0, 0.0, 0.0, 0.0],
    };
    let modules = vec![
        module("index tip", "index", 0, Some(pose), Some("index 3")),
        module("thumb tip", "thumb", 4, None, None),
    ];
    let taxels = (0..8).map(|n| Taxel {
        module: n / 4,
        x: n / 4 * 2 + n % 2,
        y: n % 4 / 2,
        position_mm: None,
    });
    Geometry::new("two-fingers", [4, 2], modules, taxels.collect())
}

/// The strongest taxel in contact of a module, with its force in counts.
fn strongest(module: &Module, force: &ForceFrame) -> Option<(usize, f64)> {
    let touched = module.taxel_range().filter(|taxel| force.contact[*taxel]);
    touched
        .map(|taxel| (taxel, force.force[taxel]))
        .max_by(|a, b| a.1.total_cmp(&b.1))
}

fn main() -> Result<(), GeometryError> {
    let hand = two_fingers()?;
    // What the skin would give: taxels 1 and 2 of the index finger are pressed.
    let mut force = ForceFrame::new(hand.len());
    for (taxel, counts) in [(1, 420.0), (2, 1350.5)] {
        (force.contact[taxel], force.force[taxel]) = (true, counts);
    }
    for module in &hand.modules {
        let Some((taxel, counts)) = strongest(module, &force) else {
            println!("{}: nothing", module.name);
            continue;
        };
        let Taxel { x, y, .. } = hand.taxels[taxel];
        print!("{}: {counts} counts at pixel ({x}, {y})", module.name);
        if let (Some(pose), Some(joint)) = (module.pose, &module.joint) {
            let [x_mm, y_mm, z_mm] = pose.position_mm;
            print!("; its module is at ({x_mm}, {y_mm}, {z_mm}) mm on the link that {joint:?} moves");
        }
        println!();
    }
    Ok(())
}
