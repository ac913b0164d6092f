//! TimeSensor (ISO/IEC 19775-1, 8.2 and 8.4.1) at one moment.
//!
//! The standard tells a machine that ticks; what holds at a moment follows from its fields alone. A clock that has stopped keeps what it
//! sent last, because the fields that it drove do.

use crate::import::x3d::{NodeRef, value::Value};

/// What a clock has sent by `now`, in seconds; `None` before it starts and where it never does.
pub(super) fn events(clock: NodeRef<'_>, now: f64) -> Option<Vec<(&'static str, Value)>> {
    let (start, stop, cycle) = (clock.double("startTime"), clock.double("stopTime"), clock.double("cycleInterval"));
    if !clock.bool("enabled") || cycle <= 0.0 || now < start {
        return None;
    }
    let looping = clock.bool("loop");
    let stops = stop > start;
    let (running, paused) = without_pause(clock, now, start);
    let mut elapsed = running - start;
    let mut active = true;
    if !looping && elapsed >= cycle {
        (elapsed, active) = (cycle, false);
    }
    if stops && now >= stop {
        let (at_stop, _) = without_pause(clock, stop, start);
        (elapsed, active) = (elapsed.min(at_stop - start), false);
    }
    let cycles = elapsed / cycle;
    let part = cycles - cycles.floor();
    // A cycle ends at 1, not at the 0 of the next one.
    let fraction = if part == 0.0 && elapsed > 0.0 { 1.0 } else { part };
    let begun = if fraction == 1.0 { cycles - 1.0 } else { cycles.floor() };
    let truth = |b: bool| Value::Ints([i32::from(b)].into());
    let seconds = |t: f64| Value::Doubles([t].into());
    Some(vec![
        ("fraction_changed", Value::Floats([fraction as f32].into())),
        ("isActive", truth(active)),
        ("isPaused", truth(paused && active)),
        ("time", seconds(start + elapsed)),
        ("elapsedTime", seconds(elapsed)),
        ("cycleTime", seconds(start + begun * cycle)),
    ])
}

/// The time that a clock shows which stood still from `pauseTime` to `resumeTime`, and whether it stands still.
fn without_pause(clock: NodeRef<'_>, now: f64, start: f64) -> (f64, bool) {
    let (pause, resume) = (clock.double("pauseTime"), clock.double("resumeTime"));
    if pause <= start || now < pause {
        (now, false)
    } else if resume > pause && now >= resume {
        (now - (resume - pause), false)
    } else {
        (pause, true)
    }
}
