//! Which compilation of the gather's inner loops runs: the baseline, or the same source with AVX2 switched on.
//!
//! Both do the same operations in the same order, without fused multiply-add, and so give the same bits; only speed differs.

/// What the configuration asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Simd {
    /// The widest vectors that the CPU has.
    #[default]
    Auto,
    /// The baseline that every CPU has.
    Portable,
}

/// What runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// The baseline of the target.
    Portable,
    /// Proof that this CPU has AVX2: only [`Kernel::select`] makes one.
    #[cfg(target_arch = "x86_64")]
    Avx2(Detected),
}

/// Cannot be made outside this module.
#[cfg(target_arch = "x86_64")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Detected(());

impl Simd {
    /// The names of the CPU features that this choice makes use of here.
    #[must_use]
    pub fn features(self) -> Vec<String> {
        match Kernel::select(self) {
            Kernel::Portable => vec![],
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2(_) => vec!["avx2".into()],
        }
    }
}

impl Kernel {
    /// Looks at the CPU once.
    #[must_use]
    pub fn select(simd: Simd) -> Self {
        match simd {
            #[cfg(target_arch = "x86_64")]
            Simd::Auto if std::arch::is_x86_feature_detected!("avx2") => Self::Avx2(Detected(())),
            Simd::Auto | Simd::Portable => Self::Portable,
        }
    }
}
