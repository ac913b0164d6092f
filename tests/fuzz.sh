#!/usr/bin/env bash
# Fuzzes parsers: tests/fuzz.sh OUT SECONDS [TARGET…]. Each target gets SECONDS of processor time; one at a time, all where none is named.
# It needs a nightly toolchain. What libFuzzer finds beside the seeds stays in OUT/TARGET and is where the next run begins; a crash is left
# in fuzz/artifacts and belongs into fuzz/corpus once it is mended.
#   SANITIZER=none    or `address`, for what lies behind the decoders by others (zstd, JPEG, deflate), which have unsafe code: several
#                     times slower. Kiln's own crates forbid it, so that coverage alone finds what can be wrong in them.
#
# The targets judge time and memory of each input themselves. The dictionary is every short string in the parsers' sources: names of nodes,
# fields and extensions that mutation of bytes would hardly hit.
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
cargo +nightly fuzz build -s "${SANITIZER:-none}"
BUILT=${CARGO_TARGET_DIR:-fuzz/target}/$(rustc +nightly -vV | sed -n 's/^host: //p')/release
for name in "$@"; do
    mkdir -p "$OUT/$name" "fuzz/artifacts/$name"
    # An image may declare 2 GiB of pixels, within the limits; anything above four is a leak.
    "$BUILT/$name" -timeout=20 -rss_limit_mb=4096 -max_len=65536 -dict="$OUT/words.dict" -handle_usr1=1 -print_final_stats=1 \
        -artifact_prefix="fuzz/artifacts/$name/" "$OUT/$name" "fuzz/corpus/$name" > "$OUT/$name.log" 2>&1 &
    # libFuzzer's own limit goes by the wall clock, which says little on a busy machine. Asked to end, it ends the input at hand first: one
    # that hangs is found.
    while used=$(ps -o cputimes= -p $!) && [ "$used" -lt "$SECONDS_EACH" ]; do sleep 1; done
    kill -USR1 $! 2> /dev/null || true
    if ! wait $!; then
        tail -40 "$OUT/$name.log"
        exit 1
    fi
    echo "$name: $SECONDS_EACH s of processor time, $(awk '/number_of_executed_units/ { print $2 }' "$OUT/$name.log") inputs, no finding"
done
