#!/usr/bin/env bash
# Fuzzes parsers: tests/fuzz.sh OUT SECONDS [TARGET…]. Each target gets SECONDS of processor time; one at a time, all where none is named.
# It needs a nightly toolchain. What libFuzzer finds beside the seeds stays in OUT/TARGET and is where the next run begins; a crash is left
# in fuzz/artifacts and belongs into fuzz/corpus once it is mended.
#
# Coverage guides it, without a sanitizer: the crates forbid unsafe code, so what AddressSanitizer would look for cannot be written, and
# without it several times as many inputs are tried. The targets judge time and memory themselves. The dictionary is every short string
# in the parsers' sources: names of nodes, fields and extensions that mutation of bytes would hardly hit.
set -euo pipefail

[ $# -ge 2 ] || { echo "usage: tests/fuzz.sh OUT SECONDS [TARGET…]" >&2; exit 2; }
OUT=$(realpath -m "$1") SECONDS_EACH=$2
shift 2
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- $(basename -s .rs fuzz/fuzz_targets/*.rs)
command -v cargo-fuzz > /dev/null || cargo install --locked cargo-fuzz
mkdir -p "$OUT"

grep -rhoE '"[][A-Za-z0-9_:/ .@#<>{},-]{2,40}"' --include='*.rs' --exclude-dir=tests --exclude='tests.rs' coordinator/src/import proto/src \
    | sort -u > "$OUT/words.dict"

# One build for all: `cargo fuzz run` would ask cargo again for each.
cargo +nightly fuzz build -s none
BUILT=${CARGO_TARGET_DIR:-fuzz/target}/$(rustc +nightly -vV | sed -n 's/^host: //p')/release
ulimit -c 0
for name in "$@"; do
    mkdir -p "$OUT/$name" "fuzz/artifacts/$name"
    # The limit of the shell ends the run (SIGXCPU): libFuzzer's own goes by the wall clock, which says little on a busy machine.
    # An image may declare 2 GiB of pixels, within the limits; anything above four is a leak.
    code=0
    (
        ulimit -St "$SECONDS_EACH"
        exec "$BUILT/$name" -timeout=20 -rss_limit_mb=4096 -max_len=65536 -dict="$OUT/words.dict" \
            -artifact_prefix="fuzz/artifacts/$name/" "$OUT/$name" "fuzz/corpus/$name"
    ) > "$OUT/$name.log" 2>&1 || code=$?
    if [ $code != $((128 + $(kill -l XCPU))) ]; then
        tail -40 "$OUT/$name.log"
        exit 1
    fi
    echo "$name: $SECONDS_EACH s of processor time, $(grep -oE '^#[0-9]+' "$OUT/$name.log" | tail -1 | tr -d '#') inputs or more, no finding"
done
