//! Choices that have names on the command line and in results: enums from a list of names.

pub(crate) use clap::ValueEnum;
pub(crate) use clap::builder::PossibleValue;

/// Defines enums whose variants have names: `name()`, `Display`, `FromStr` and clap's `ValueEnum`.
macro_rules! choices {
    ($($(#[$doc:meta])* $name:ident { $($(#[$vdoc:meta])* $variant:ident = $text:literal,)* })*) => { $(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vdoc])* $variant,)* }

        impl $name {
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.name())
            }
        }

        impl $crate::names::ValueEnum for $name {
            fn value_variants<'a>() -> &'a [Self] {
                &[$(Self::$variant,)*]
            }

            fn to_possible_value(&self) -> Option<$crate::names::PossibleValue> {
                Some($crate::names::PossibleValue::new(self.name()))
            }
        }

        impl std::str::FromStr for $name {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let known = [$(Self::$variant,)*];
                known.into_iter().find(|one| one.name() == text).ok_or_else(|| {
                    let names = known.map(Self::name).join(", ");
                    format!("there is no {text:?}: choose {names}")
                })
            }
        }
    )* };
}
pub(crate) use choices;
