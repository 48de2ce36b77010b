//! What a program serves that makes no images: texts alone.

use crate::profiles::profile_maker::{Cost, DisplayProfile, MadeOutput, Measurement, ProfileMaker};
use taxel_wire::Hello;

/// A maker of no images: subscribers get the HELLO and what the program announces. A stated profile
/// is refused.
#[derive(Debug, Clone)]
pub struct Announcements {
    hello: Hello,
}

impl Announcements {
    /// `hello` describes the hand and the program.
    pub fn new(hello: Hello) -> Self {
        Self { hello }
    }
}

impl ProfileMaker for Announcements {
    type Frames = ();

    fn hello(&self, _: &DisplayProfile) -> Hello {
        self.hello.clone()
    }

    fn output(&self, _: &DisplayProfile) -> Result<Option<MadeOutput<()>>, String> {
        Ok(None)
    }

    fn measurement(&self, _: &DisplayProfile, _: u64) -> Result<Measurement, String> {
        Ok(Box::new(Cost::default))
    }

    fn raw(&self) -> Option<MadeOutput<()>> {
        None
    }

    fn region(&self, _: &[String]) -> Result<Option<Vec<String>>, String> {
        Err("this program makes no images".into())
    }

    fn period_ns(&self) -> u64 {
        1_000_000_000
    }
}
