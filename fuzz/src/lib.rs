//! What every fuzz target does around its parser: it counts memory and time.
//!
//! Too much of either is a crash, and libFuzzer keeps the input. Time is that of the processor, of all threads: a wall clock would judge
//! how busy the machine is. A picture that is declared, and taken, may take the time of its pixels. (`-timeout` of libFuzzer ends what hangs
//! for good.)

pub mod bounds;

pub use kiln_coordinator::fuzzing::Target;
pub use libfuzzer_sys;

use rustix::time::{ClockId, clock_gettime};
use std::time::Duration;

#[global_allocator]
static ALLOCATOR: bounds::Counting = bounds::Counting;

/// A second for every this many bytes, and for less.
const BYTES_PER_SECOND: f64 = 100_000.0;
/// And a second for every this many bytes of pictures that are declared, at 16 a pixel: decoders with debug assertions are slow.
const DECLARED_PER_SECOND: f64 = 256e6;

/// What the process has had of processors until now.
fn processor_time() -> Duration {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(now.tv_sec.unsigned_abs(), u32::try_from(now.tv_nsec).unwrap_or_default())
}

/// Runs one input.
///
/// # Panics
/// Where the parser does, and where it took more time or memory than it may.
pub fn run(target: Target, input: &[u8]) {
    let begun = processor_time();
    let peak = bounds::peak(|| (target.run)(input));
    let (took, most) = (processor_time() - begun, (input.len() as f64 / BYTES_PER_SECOND).max(1.0));
    // What is declared is looked for only where it matters: it costs more than most parsers.
    if took.as_secs_f64() > most || peak > bounds::allowed(input, 0) {
        let declared = (target.images)(input);
        let most = Duration::from_secs_f64(most + declared as f64 / DECLARED_PER_SECOND);
        assert!(took <= most, "{}: {} bytes took {took:?}; {most:?} are allowed", target.name, input.len());
        let allowed = bounds::allowed(input, declared);
        assert!(peak <= allowed, "{}: {} bytes of input took {peak} bytes at once; {allowed} are allowed", target.name, input.len());
    }
}

/// A fuzz target by its name.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        $crate::libfuzzer_sys::fuzz_target!(|input: &[u8]| {
            static TARGET: ::std::sync::LazyLock<$crate::Target> = ::std::sync::LazyLock::new(|| $crate::find($name));
            $crate::run(*TARGET, input);
        });
    };
}

/// The target of this name.
///
/// # Panics
/// Where there is none: the file that asks is named wrongly.
#[must_use]
pub fn find(name: &str) -> Target {
    kiln_coordinator::fuzzing::find(name).unwrap_or_else(|| panic!("kiln_coordinator::fuzzing has no target `{name}`"))
}
