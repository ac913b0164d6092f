#!/usr/bin/env bash
# Pictures for the rows of docs/checklist.md, to be looked at: small scenes that show at a glance what tests measure. A minute or two.
#   tests/checklist.sh FOLDER     packages and PNGs go there
#   KILN=target/debug/kiln
set -euo pipefail
OUT=$(realpath -m "${1:?where to put the pictures: tests/checklist.sh FOLDER}")
cd "$(dirname "$0")/.."
KILN=${KILN:-target/debug/kiln}
SCENES=tests/scenes/checklist
SKY="--environment $SCENES/sky.hdr"
mkdir -p "$OUT"

bake() { "$KILN" bake "$SCENES/$1.x3dv" -o "$OUT/$1-package" --preset draft --texel-scale 1 "${@:2}" > /dev/null; }
show() { "$KILN" render "$OUT/$1-package" -o "$OUT/$2.png" --size 480x360 --camera "${@:3}"; }

# shellcheck disable=SC2086 # SKY is two words.
bake atlas --texels-per-metre 24 --samples 512 $SKY
show atlas atlas front
show atlas atlas-close close
bake terminator --texels-per-metre 24 --samples 256
show terminator terminator front
# shellcheck disable=SC2086
bake leaks --texels-per-metre 10 --samples 64 $SKY
show leaks leaks-outside outside
for room in 1 2 3 4; do show leaks "leaks-inside-$room" "inside $room" --exposure 4; done
bake floor --texels-per-metre 16 --samples 1024
for view in left right close; do show floor "floor-$view" "$view"; done
bake alpha-sides --texels-per-metre 24 --samples 256
for view in front behind; do show alpha-sides "alpha-sides-$view" "$view"; done
