//! Instruction sets of the processor, and selection of the widest available one at run time.
//!
//! They are separate from the number types, because GPUs have a single instruction set.

/// Instruction set that the cell loop uses. All levels give the same bits and differ in speed only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Scalar instructions of any processor.
    Scalar,
    /// AVX2 with FMA: four lanes of f64.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512 with F, DQ, BW and VL: eight lanes of f64.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// Returns `true` if the processor has AVX-512 with 64-bit integers and shorter vectors, like all server and
/// desktop processors with AVX-512.
#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vl")
}

impl Level {
    /// Returns the widest level of this processor; `SOLVER_LANES=scalar|avx2` selects a lower one (for tests and
    /// comparisons).
    #[must_use]
    pub fn best() -> Self {
        let wish = std::env::var("SOLVER_LANES").unwrap_or_default();
        if wish == "scalar" {
            return Self::Scalar;
        }
        #[cfg(target_arch = "x86_64")]
        {
            if wish != "avx2" && has_avx512() {
                return Self::Avx512;
            }
            if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
                return Self::Avx2;
            }
        }
        Self::Scalar
    }

    /// Returns the name of the level for the provenance of a run.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => "avx2+fma",
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => "avx512",
        }
    }
}

/// Loops without branches or calls, which the compiler vectorises, with a version for each instruction set
/// ([`Level::run`]).
pub trait Work {
    /// Runs the loops. This function and those that it calls must be `#[inline(always)]`, so that they are compiled
    /// for the instruction set.
    fn run(self);
}

impl Level {
    /// Runs the version of the loops for this level.
    pub fn run(self, work: impl Work) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 if has_avx512() => {
                // SAFETY: the processor has this instruction set, which includes AVX2.
                unsafe { run_avx512(work) };
            }
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 | Self::Avx2 if is_x86_feature_detected!("avx2") => {
                // SAFETY: the processor has this instruction set.
                unsafe { run_avx2(work) };
            }
            _ => work.run(),
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512bw,avx512vl,avx2")]
fn run_avx512(work: impl Work) {
    work.run();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(work: impl Work) {
    work.run();
}
