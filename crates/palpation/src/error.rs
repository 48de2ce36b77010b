//! Why touches cannot be categorised.

/// Why touches cannot be categorised. Touches, features and clusters count from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PalpationError {
    /// One touch has no variance, none has no mean.
    #[error("categories need at least 2 touches; there {}", there(*touches))]
    TooFew {
        /// How many there are.
        touches: usize,
    },
    /// Touches of nothing.
    #[error("a touch has no features; give each at least one taxel and one step")]
    NoFeatures,
    /// A number that is none.
    #[error("touch {touch}, feature {feature} is {value}; every feature must be a finite number")]
    NotFinite {
        /// The touch.
        touch: usize,
        /// The feature.
        feature: usize,
        /// Its value.
        value: f64,
    },
    /// All touches are the same.
    #[error(
        "all {touches} touches are the same, so they have no components and no categories; is the probe connected?"
    )]
    Constant {
        /// How many there are.
        touches: usize,
    },
    /// No component was asked for.
    #[error("a map of 0 components has no distances; ask for at least 1")]
    NoComponents,
    /// There is no decomposition.
    #[error(
        "the squares of {touches} touches of {features} features are beyond what numbers can be; \
             are the values of one scale?"
    )]
    NotConverged {
        /// Touches of the basis.
        touches: usize,
        /// Features of each.
        features: usize,
    },
    /// The map is of another probe or motion.
    #[error(
        "a touch has {found} features, and the map is of touches with {expected}; it is of another probe or motion"
    )]
    OtherProbe {
        /// What the map was made of.
        expected: usize,
        /// What a touch has.
        found: usize,
    },
    /// More clusters than can be told apart, or fewer than two.
    #[error("{clusters} categories of {different} different touches; ask for {}", from_2_to(*different))]
    Clusters {
        /// The number asked for.
        clusters: usize,
        /// Touches that differ.
        different: usize,
    },
    /// The publication's rule found no three equal runs.
    #[error(
        "three random starts never agreed in {attempts} attempts, so the publication's rule discards {clusters} \
             categories; take another number or `optimal`"
    )]
    NoAgreement {
        /// The number of categories asked for.
        clusters: usize,
        /// Attempts of three runs.
        attempts: u32,
    },
    /// Labels that belong to other touches.
    #[error("{labels} labels for {touches} touches")]
    Labels {
        /// How many labels were given.
        labels: usize,
        /// How many touches there are.
        touches: usize,
    },
    /// One category only, or none: nothing to compare.
    #[error("a silhouette needs at least 2 categories that have touches; there are {clusters}")]
    OneCluster {
        /// How many have touches.
        clusters: usize,
    },
    /// A class that no touch has.
    #[error("no touch is of class {class}, so no distance can be ranked by it")]
    NoSuchClass {
        /// The class.
        class: usize,
    },
}

fn there(touches: usize) -> String {
    match touches {
        0 => "is none".into(),
        1 => "is 1".into(),
        _ => format!("are {touches}"),
    }
}

fn from_2_to(most: usize) -> String {
    if most > 2 {
        format!("2 to {most}")
    } else {
        "2".into()
    }
}
