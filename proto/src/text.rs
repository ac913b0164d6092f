//! Types that are written as a text wherever serde writes them.

/// Conversions from and to `String` by `FromStr` and `Display`, for `#[serde(try_from = "String", into = "String")]`.
#[macro_export]
macro_rules! written_as_text {
    ($name:ident) => {
        impl TryFrom<String> for $name {
            type Error = <$name as std::str::FromStr>::Err;
            fn try_from(text: String) -> Result<Self, Self::Error> {
                text.parse()
            }
        }

        impl From<$name> for String {
            fn from(value: $name) -> String {
                value.to_string()
            }
        }
    };
}
