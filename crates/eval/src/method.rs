//! The methods that are judged: profiles by name.

use taxel_compress::learn_codebook;
use taxel_hand::{ForceFrame, Profile, ProfileError, plain_words};

/// A way to compress frames, and what it is called in reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Method {
    /// Its name: a method, then what differs from it, such as `optimal history=0.5`.
    pub name: String,
    /// The profile.
    pub profile: Profile,
    /// Whether the profile's codebook is still to be learned from the frames, by
    /// [`learn_from`](Self::learn_from).
    pub learned: bool,
}

/// Why a text names no method.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// No method at the beginning, or a setting without a value.
    #[error(
        "`{text}` is no method; write `paper` or `optimal`, then settings of the profile such as history=0.5"
    )]
    Form {
        /// What was given.
        text: String,
    },
    /// A setting that a profile does not have, or a value that it does not take.
    #[error("`{text}`: {problem}")]
    Setting {
        /// What was given.
        text: String,
        /// In the words of the profile's reader.
        problem: String,
    },
    /// A profile that describes no display.
    #[error("`{text}`: {source}")]
    Profile {
        /// What was given.
        text: String,
        /// Why.
        source: ProfileError,
    },
}

/// What stands between blanks, but for those within brackets: `codebook=[1.0, 2.0]` is one word.
fn words(text: &str) -> Vec<&str> {
    let mut depth = 0_usize;
    let is_between = |c: char| {
        match c {
            '[' | '{' => depth += 1,
            ']' | '}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        depth == 0 && c.is_whitespace()
    };
    text.split(is_between).filter(|word| !word.is_empty()).collect()
}

impl Method {
    /// Reads a method: `paper` or `optimal`, then settings as `key=value` with spaces between them,
    /// which take the place of those in `base`. Values are those of the configuration's `[profile]`
    /// table; quotes around words may be left out. `codebook=learned` stands for the constant
    /// codebook with the least squared error over all frames that the method will be judged on.
    ///
    /// ```
    /// use taxel_hand::Profile;
    /// let method = taxel_eval::Method::parse("optimal history=0.5 placement=lloyd", &Profile::default())?;
    /// assert_eq!(method.profile.history, 0.5);
    /// # Ok::<(), taxel_eval::MethodError>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`MethodError`], with the text and what is wrong with it.
    pub fn parse(text: &str, base: &Profile) -> Result<Self, MethodError> {
        let form = || MethodError::Form { text: text.into() };
        let setting = |problem: String| MethodError::Setting {
            text: text.into(),
            problem,
        };
        let mut words = words(text).into_iter();
        let method = words.next().filter(|word| !word.contains('=')).ok_or_else(form)?;
        let mut table = toml::Table::try_from(base).map_err(|e| setting(e.to_string()))?;
        table.insert("method".into(), method.into());
        let mut learned = false;
        for word in words {
            let (key, value) = word.split_once('=').ok_or_else(form)?;
            if (key, value) == ("codebook", "learned") {
                learned = true;
                continue;
            }
            let line = format!("{key} = {value}");
            let read = line
                .parse::<toml::Table>()
                .or_else(|_| format!("{key} = \"{value}\"").parse())
                .map_err(|e| setting(plain_words(e.message())))?;
            // A whole number where the profile has a fraction.
            for (key, value) in read {
                let value = match (table.get(&key), &value) {
                    (Some(toml::Value::Float(_)), toml::Value::Integer(whole)) => (*whole as f64).into(),
                    _ => value,
                };
                table.insert(key, value);
            }
        }
        let profile: Profile = table
            .try_into()
            .map_err(|e| setting(plain_words(&e.to_string())))?;
        let refused = |source| MethodError::Profile {
            text: text.into(),
            source,
        };
        // What excludes a codebook excludes one that is still to be learned.
        let known = Profile {
            codebook: if learned {
                vec![1.0]
            } else {
                profile.codebook.clone()
            },
            ..profile.clone()
        };
        known.check().map_err(refused)?;
        Ok(Self {
            name: text.split_whitespace().collect::<Vec<_>>().join(" "),
            profile,
            learned,
        })
    }

    /// Learns the codebook from frames where it says `codebook=learned`; otherwise does nothing.
    /// Without any contact there is nothing to learn, and levels are fitted to each frame.
    pub fn learn_from(&mut self, frames: &[ForceFrame]) {
        if std::mem::take(&mut self.learned) {
            self.profile.codebook = learn_codebook(frames, self.profile.level_count());
        }
    }
}

/// `paper` and `optimal`, then the switches between them and those that change most.
const MAIN: [&str; 6] = [
    "paper",
    "optimal",
    "paper force_fit=exact",
    "paper placement=follow",
    "optimal actuator_force=max",
    "optimal codebook=learned",
];

/// Every other switch, on its own.
const MORE: [&str; 14] = [
    "paper actuator_force=closest",
    "optimal history=0.1",
    "optimal history=0.5",
    "optimal jump_gain=0",
    "optimal jump_gain=0.1",
    "optimal jump_gain=1",
    "optimal force_distance=0",
    "optimal force_weighted=true",
    "optimal parts_apart=true",
    "optimal level_hysteresis=0.2",
    "optimal level_steps=weber",
    "optimal actuator_force=mean",
    "optimal codebook_learning={forgetting=0.001}",
    "optimal codebook_learning={forgetting=0.1}",
];

/// Methods that go with a profile, and those that its settings exclude.
#[derive(Debug, Default)]
pub struct Offered {
    /// Those that are to be judged, in the order of the list.
    pub methods: Vec<Method>,
    /// Why each of the others is not, with its name.
    pub left_out: Vec<MethodError>,
}

impl Offered {
    /// The methods of a list, each on `base`: a list for every display has methods that some displays cannot have.
    ///
    /// # Errors
    ///
    /// A text that is no method of any profile.
    pub fn of(texts: &[&str], base: &Profile) -> Result<Self, MethodError> {
        let mut offered = Self::default();
        for text in texts {
            match Method::parse(text, base) {
                Ok(method) => offered.methods.push(method),
                Err(excluded @ MethodError::Profile { .. }) => offered.left_out.push(excluded),
                Err(other) => return Err(other),
            }
        }
        Ok(offered)
    }
}

/// `paper`, `optimal`, and every switch between and beside them, on its own, as far as `base` has room for them.
///
/// # Errors
///
/// None for a `base` that [`Profile::check`] accepts.
pub fn standard_methods(base: &Profile) -> Result<Offered, MethodError> {
    Offered::of(&[&MAIN[..], &MORE].concat(), base)
}

/// Those of the [`standard_methods`] that a first look at a recording needs.
///
/// # Errors
///
/// None for a `base` that [`Profile::check`] accepts.
pub fn main_methods(base: &Profile) -> Result<Offered, MethodError> {
    Offered::of(&MAIN, base)
}

#[cfg(test)]
mod tests {
    use super::*;
    use taxel_hand::{ForceFit, Placement};

    #[test]
    fn settings_take_the_place_of_the_base() {
        let base = Profile {
            levels: 5,
            ..Profile::default()
        };
        let method = Method::parse("paper  placement=follow history=1", &base).unwrap();
        assert_eq!(method.name, "paper placement=follow history=1");
        assert_eq!((method.profile.levels, method.profile.history), (5, 1.0));
        assert_eq!(method.profile.placement(), Placement::Follow);
        assert_eq!(method.profile.force_fit(), ForceFit::Lloyd);
        let lists = "optimal actuators=1\tcodebook=[1.0, 2.0] fixed=[[1, 2]]";
        let method = Method::parse(lists, &base).unwrap();
        assert_eq!(method.profile.codebook, [1.0, 2.0]);
        assert_eq!(method.profile.fixed, [[1.0, 2.0]]);
    }

    #[test]
    fn what_is_no_method_is_refused_with_the_reason() {
        for (text, wanted) in [
            ("", "is no method"),
            ("history=1", "is no method"),
            ("optimal history", "is no method"),
            ("best", "best"),
            ("optimal colour=red", "colour"),
            ("optimal history=-1", "history"),
            ("optimal levels=many", "levels"),
        ] {
            let message = Method::parse(text, &Profile::default()).unwrap_err().to_string();
            assert!(message.contains(wanted), "{text:?}: {message}");
        }
    }

    #[test]
    fn a_codebook_is_learned_from_the_frames_once() {
        let mut frame = ForceFrame::new(4);
        frame.force.copy_from_slice(&[10.0, 12.0, 100.0, 102.0]);
        frame.contact.fill(true);
        let base = Profile {
            levels: 2,
            ..Profile::default()
        };
        let mut method = Method::parse("optimal codebook=learned", &base).unwrap();
        assert!(method.profile.codebook.is_empty());
        method.learn_from(&[frame]);
        assert_eq!(method.profile.codebook, [11.0, 101.0]);
        method.learn_from(&[ForceFrame::new(4)]);
        assert_eq!(method.profile.codebook, [11.0, 101.0]);
    }

    #[test]
    fn the_standard_methods_differ() {
        let mut frame = ForceFrame::new(1);
        frame.force[0] = 1.0;
        frame.contact[0] = true;
        let Offered {
            mut methods,
            left_out,
        } = standard_methods(&Profile::default()).unwrap();
        assert!(left_out.is_empty(), "{left_out:?}");
        methods
            .iter_mut()
            .for_each(|method| method.learn_from(&[frame.clone()]));
        for (n, method) in methods.iter().enumerate() {
            assert!(
                methods[..n].iter().all(|m| m.profile != method.profile),
                "{}",
                method.name
            );
        }
    }

    #[test]
    fn methods_that_a_display_excludes_are_left_out_and_told() {
        let steps = "level_steps = \"weber\"\nforce_min = 1.0\nforce_max = 50.0";
        for (text, excluded) in [
            (steps, &["optimal codebook=learned"][..]),
            (
                "jnd = 0.07\nforce_min = 1.0\nforce_max = 50.0",
                &["optimal codebook=learned"],
            ),
            (
                "codebook_learning = { forgetting = 0.001 }",
                &["optimal codebook=learned"],
            ),
            ("coordinates = \"hand\"", &["paper", "paper force_fit=exact"]),
            ("budgets = { thumb = 2 }", &["paper", "paper force_fit=exact"]),
            (
                "actuators = 2\nfixed = [[0.0, 0.0], [1.0, 0.0]]",
                &["paper placement=follow"],
            ),
            ("codebook = [1.0, 2.0]", &[]),
        ] {
            let base: Profile = toml::from_str(text).unwrap();
            base.check().unwrap();
            let Offered { methods, left_out } = main_methods(&base).unwrap();
            let is_excluded = |name: &&str| excluded.contains(name);
            let left: Vec<&str> = MAIN.into_iter().filter(|name| !is_excluded(name)).collect();
            assert_eq!(
                methods.iter().map(|m| &*m.name).collect::<Vec<_>>(),
                left,
                "{text}"
            );
            let told: Vec<String> = left_out.iter().map(|error| error.to_string()).collect();
            assert_eq!(told.len(), excluded.len(), "{text}");
            for (told, name) in told.iter().zip(excluded) {
                assert!(told.starts_with(&format!("`{name}`: profile: ")), "{told}");
            }
        }
    }
}
