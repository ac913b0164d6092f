//! Decoders of pictures that panic.
//!
//! They are by others, and fuzzing has found pictures on which they panic (zune-jpeg's chroma upsampler, for one). What such a picture
//! costs its scene is an error at the place that names it, as for any broken one. Refusing by hand what a decoder cannot bear would mean
//! to know its faults; a process of its own for each picture costs more than the picture.

use std::{
    cell::Cell,
    panic::{self, AssertUnwindSafe, catch_unwind},
    sync::Once,
};

thread_local! {
    static DECODING: Cell<bool> = const { Cell::new(false) };
}

/// A decoder panicked.
#[derive(Debug, thiserror::Error)]
#[error("cannot be decoded: its decoder failed in a way that nobody foresaw ({0}); save the picture anew with another program")]
pub(super) struct Panicked(String);

/// Runs a decoder; its panic becomes an error.
pub(super) fn guarded<T, E: From<Panicked>>(decode: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    static HOOK: Once = Once::new();
    HOOK.call_once(pass_over_decoders);
    let before = DECODING.replace(true);
    // What a decoder leaves behind half done is its own, and gone with it.
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    DECODING.set(before);
    decoded.unwrap_or_else(|payload| {
        let said = payload.downcast_ref::<String>().cloned();
        let said = said.or_else(|| payload.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        Err(Panicked(said.unwrap_or_else(|| "without a word".to_owned())).into())
    })
}

/// Keeps the panic hook from what becomes an error: a backtrace takes many times the memory of the picture, and libFuzzer's hook would end
/// the process.
fn pass_over_decoders() {
    let last = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !DECODING.get() {
            last(info);
        }
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::import::texture;
    use kiln_proto::scene::Coding;

    #[test]
    fn a_panic_is_an_error_and_what_comes_after_is_on_its_own() {
        let broken = guarded(|| -> Result<(), Panicked> { panic!("by a decoder") });
        let said = broken.unwrap_err().to_string();
        assert!(said.starts_with("cannot be decoded") && said.contains("(by a decoder)"), "{said}");
        let within = guarded(|| {
            let inner = guarded(|| Ok::<_, Panicked>(DECODING.get()))?;
            Ok::<_, Panicked>(inner && DECODING.get())
        });
        assert!(within.unwrap() && !DECODING.get());
    }

    #[test]
    fn a_picture_on_which_its_decoder_panics_is_refused() {
        let picture = include_bytes!("../../../fuzz/corpus/image/panic-in-zune-jpeg.jpg");
        let refused = texture::decode("p.jpg", picture, Coding::Srgb, false);
        assert!(refused.err().unwrap().to_string().contains("its decoder failed"));
    }
}
