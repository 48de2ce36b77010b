//! What is wrong with the daemon's readers: there are too many.

use crate::kind::Kind;
use crate::problem::{Place, Problem};

/// Clients are turned away since all places are taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crowd {
    /// How many readers there may be.
    pub places: usize,
    /// How many the configuration would allow, where more files could be open.
    pub most: usize,
    /// Who holds the places: user, process, and how many, the most first. What the kernel does not say is `None`.
    pub holders: Vec<(Option<u32>, Option<i32>, usize)>,
}

/// Holders of places that are named.
const NAMED: usize = 3;

pub(crate) fn turned_away(crowd: &Crowd) -> Problem {
    let known = |id: Option<String>| id.unwrap_or_else(|| "?".into());
    let named: Vec<String> = (crowd.holders.iter().take(NAMED))
        .map(|(uid, pid, places)| {
            let (uid, pid) = (uid.map(|uid| uid.to_string()), pid.map(|pid| pid.to_string()));
            format!("process {} of user {} has {places}", known(pid), known(uid))
        })
        .collect();
    let raise = match crowd.places < crowd.most {
        true => format!(
            "allow more open files, too few for [socket] max_subscribers = {} (LimitNOFILE= in the unit, or `ulimit \
             -Hn`),",
            crowd.most
        ),
        false => "raise [socket] max_subscribers".into(),
    };
    Problem::new(
        Kind::ReadersTurnedAway,
        Place::Daemon,
        format!(
            "readers of images find no place, since all {} are taken: {}",
            crowd.places,
            named.join(", ")
        ),
        format!("end those that are not needed, or {raise} and restart"),
        "there is a place for every reader again",
    )
}
