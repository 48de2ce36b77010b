//! How a part of the status is written, and what it says of its keys.

use serde::Serialize;

/// A part of the status that says what its keys are.
pub trait Report: Serialize {
    /// Its keys, in their order.
    const KEYS: &'static [Key];
}

/// What there is to say of a key of the status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// What it is, as the page of the status says it.
    pub about: &'static str,
    /// Whether it counts from the daemon's start on.
    pub is_count: bool,
}

macro_rules! keys {
    ($name:ident { $($(#[doc = $about:literal])* $key:ident: $type:ty,)* }) => {
        impl $crate::status::Report for $name {
            const KEYS: &'static [$crate::status::Key] = &[$($crate::status::Key {
                name: stringify!($key),
                about: concat!($($about),*).trim_ascii_start(),
                is_count: matches!(stringify!($type).as_bytes(), b"u64"),
            }),*];
        }
    };
}
pub(crate) use keys;

macro_rules! report {
    ($($(#[$doc:meta])* $name:ident {
        $($(#[doc = $about:literal])* $(#[serde($($of:tt)*)])* $key:ident: $type:ty,)*
    })*) => {$(
        $(#[$doc])*
        #[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default)]
        pub struct $name { $($(#[doc = $about])* $(#[serde($($of)*)])* pub $key: $type,)* }
        $crate::status::report::keys!($name { $($(#[doc = $about])* $key: $type,)* });
    )*};
}
pub(crate) use report;
