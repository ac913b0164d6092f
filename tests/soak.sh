#!/usr/bin/env bash
# What takes longer than a test should (`make soak`): every reference query, a full-size bake with every claim measured again, the
# encodings that the thesis tabulates, the measurements of speed, and fuzzing. Needs some 8 GiB in OUT; hours on two cores.
#   OUT=folder        where packages and figures go (default: kiln-soak in TMPDIR)
#   SAMPLES=1024      samples of the full-size bake
#   THREADS=0         threads of the bake; 0 is all cores
#   FUZZ=600          seconds of processor time for each fuzz target (needs a nightly toolchain); 0 leaves them out
set -euo pipefail
cd "$(dirname "$0")/.."

OUT=${OUT:-${TMPDIR:-/tmp}/kiln-soak}
SAMPLES=${SAMPLES:-1024}
THREADS=${THREADS:-0}
FUZZ=${FUZZ:-600}
ROOM=tests/scenes/thesis-room
KILN=target/debug/kiln
export KILN_SOAK=1

step() { printf '\n== %s (%s)\n' "$1" "$(date -u +%H:%M:%S)"; }

if [ -e "$OUT/room" ]; then
    echo "$OUT holds the packages of an earlier run: remove it, or set OUT to another folder" >&2
    exit 2
fi
mkdir -p "$OUT"

step "build"
cargo build --bin kiln

step "the estimator against true radiance: all queries"
cargo test --test system -- --nocapture reference

step "a storm over three coordinators and twenty workers"
cargo test --test system -- --nocapture chaos | tee "$OUT/chaos.txt"

step "glTF's materials against Mitsuba: every value of a floor of GGX"
cargo test -p kiln-worker --lib -- --nocapture a_floor_of_ggx

step "simulated networks: 500 seeds"
cargo test -p kiln-coordinator --lib -- --nocapture simulated

step "the API against its document: 200 made-up requests for each operation and kind"
cargo test --test system -- --nocapture contract

step "thesis-room at nominal sizes, $SAMPLES samples"
time "$KILN" bake "$ROOM/thesis.obj" --settings "$ROOM/nominal.json" --preset preview --samples "$SAMPLES" --max-depth 5 \
    --raw u8 --threads "$THREADS" -o "$OUT/room"

step "every claim of it, measured again"
"$KILN" inspect --verify "$OUT/room" | tee "$OUT/room.txt"

# One bake, many encodings: `kiln encode` codes the raw radiance again.
for rule in thesis cumulative; do
    for threshold in 0 6 9; do
        step "encoding: $rule, T = $threshold"
        "$KILN" encode "$OUT/room" -o "$OUT/$rule-$threshold" --rule "$rule" --threshold "$threshold"
        "$KILN" inspect --verify "$OUT/$rule-$threshold" | tee "$OUT/$rule-$threshold.txt"
    done
done
step "encoding: bounded, eps = 2"
"$KILN" encode "$OUT/room" -o "$OUT/bounded-2" --rule bounded --eps 2
"$KILN" inspect --verify "$OUT/bounded-2" | tee "$OUT/bounded-2.txt"

step "the page: first picture, frame times and memory of each way to draw, on two software GPUs"
(cd tests/browser && npm ci --no-audit --no-fund --ignore-scripts --loglevel=error)
"$KILN" --json view "$OUT/room" > "$OUT/view.json" &
VIEW=$!
trap 'kill $VIEW' EXIT
until [ -s "$OUT/view.json" ]; do sleep 0.1; done
URL=$(sed 's/.*"url":"\([^"]*\)".*/\1/' "$OUT/view.json")
for gpu in swiftshader llvmpipe; do
    node tests/browser/bench.mjs "$URL" $gpu | tee -a "$OUT/page.jsonl"
done

step "pictures for the checklist of a bake, to be looked at"
tests/checklist.sh "$OUT/checklist"

step "equal noise: the shared gather against a path per direction"
cargo bench -p kiln-worker --bench equal_noise | tee "$OUT/equal_noise.jsonl"
step "the cost of a full-size bake"
cargo bench -p kiln-worker --bench capture | tee "$OUT/capture.jsonl"
step "how well charts fill their textures"
cargo bench -p kiln-coordinator --bench unwrap | tee "$OUT/unwrap.jsonl"

if [ "$FUZZ" != 0 ]; then
    step "fuzzing each parser for $FUZZ s of processor time"
    tests/fuzz.sh "$OUT/fuzz" "$FUZZ"
    step "the same for those behind which lie decoders by others, with AddressSanitizer"
    SANITIZER=address tests/fuzz.sh "$OUT/fuzz" "$FUZZ" image hdr exr zip bundle x3d_gzip glb frame
fi

step "done: figures and packages are in $OUT"
