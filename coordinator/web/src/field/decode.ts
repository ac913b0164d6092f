/**
 * The reference decoder of `pwl` in TypeScript: what the Rust crate's `proto::codec::pwl` does, integer for integer, and the blocks of
 * texels that it is run over to fill textures.
 *
 * A block is a rectangle of texels with its own kept samples, so that a tile that has just been baked and a band of a finished surface take
 * the same way to the GPU, and a worker needs nothing but the block.
 */

import type { KeptSamples } from '../format/coded.ts';

/** A rectangle of texels of one surface. */
export interface Block {
  x: number;
  y: number;
  width: number;
  height: number;
  /** Row in `kept` of each texel, row by row, -1 where it holds no light. null: every texel has the row of its place. */
  rowOf: Int16Array | Int32Array | null;
  kept: KeptSamples;
}

/** A block ready for the GPU. */
export interface ExpandedBlock {
  x: number;
  y: number;
  width: number;
  height: number;
  /** By direction, texel row, texel: red, green, blue as coded, then 255 where the texel holds light and 0 where it does not. */
  layers: Uint8Array | null;
  /** By texel: mean radiance over the hemisphere times the exposure, linear, then 1 where the texel holds light. */
  mean: Float32Array;
}

/** `floor(a + (b - a) t / length + 1/2)`, exactly, for integers 0 <= t <= length. */
export const between = (a: number, b: number, t: number, length: number): number =>
  Math.floor((2 * a * length + 2 * (b - a) * t + length) / (2 * length));

/** sRGB to linear, for each byte. */
export const EOTF: Float32Array = Float32Array.from({ length: 256 }, (_, v) => {
  const s = v / 255;
  return s <= 0.04045 ? s / 12.92 : Math.pow((s + 0.055) / 1.055, 2.4);
});

/** Decodes row `row` into D x 3 bytes, in order of steps. */
export function decodeRow(kept: KeptSamples, row: number, out: Uint8Array): void {
  const { starts, steps, indices, rgb } = kept;
  const end = starts[row + 1];
  for (let k = starts[row]; k + 1 < end; k++) {
    const [from, to] = [steps[k], steps[k + 1]];
    const a = (indices ? indices[k] : k) * 3;
    const b = (indices ? indices[k + 1] : k + 1) * 3;
    const length = to - from;
    for (let c = 0; c < 3; c++) {
      const [va, vb] = [rgb[a + c], rgb[b + c]];
      let at = from * 3 + c;
      if (va === vb) {
        for (let t = 0; t <= length; t++, at += 3) out[at] = va;
      } else {
        // Numerators step by a constant; they stay below 2^31, so that `| 0` is the floor of a positive quotient.
        let numerator = 2 * va * length + length;
        const slope = 2 * (vb - va);
        for (let t = 0; t <= length; t++, at += 3, numerator += slope) out[at] = (numerator / (2 * length)) | 0;
      }
    }
  }
}

/**
 * Decodes a block. `depthOf` names the depth of each step and `weights` the share of each depth in the mean (they sum to one); `layered`
 * leaves out the layers where only the mean is wanted.
 */
export function expandBlock(block: Block, depthOf: Uint16Array, weights: Float64Array, layered: boolean): ExpandedBlock {
  const { x, y, width, height, rowOf, kept } = block;
  const texels = width * height;
  const directions = depthOf.length;
  const layers = layered ? new Uint8Array(texels * directions * 4) : null;
  const mean = new Float32Array(texels * 4);
  const row = new Uint8Array(directions * 3);
  for (let texel = 0; texel < texels; texel++) {
    const r = rowOf ? rowOf[texel] : texel;
    if (r < 0 || kept.starts[r] === kept.starts[r + 1]) continue;
    decodeRow(kept, r, row);
    let [red, green, blue] = [0, 0, 0];
    for (let step = 0, at = 0; step < directions; step++, at += 3) {
      const depth = depthOf[step];
      const w = weights[depth];
      red += w * EOTF[row[at]];
      green += w * EOTF[row[at + 1]];
      blue += w * EOTF[row[at + 2]];
      if (layers) {
        const to = (depth * texels + texel) * 4;
        layers[to] = row[at];
        layers[to + 1] = row[at + 1];
        layers[to + 2] = row[at + 2];
        layers[to + 3] = 255;
      }
    }
    mean.set([red, green, blue, 1], texel * 4);
  }
  return { x, y, width, height, layers, mean };
}

/** The kept samples of the texels `first .. last` of a surface, copied so that they can be handed to a worker. */
export function sliceKept(kept: KeptSamples, first: number, last: number): KeptSamples {
  const [from, to] = [kept.starts[first], kept.starts[last]];
  const starts = kept.starts.slice(first, last + 1);
  for (let i = 0; i < starts.length; i++) starts[i] -= from;
  const indices = kept.indices ? kept.indices.slice(from, to) : null;
  const rgb = kept.indices ? kept.rgb : kept.rgb.slice(from * 3, to * 3);
  return { starts, steps: kept.steps.slice(from, to), indices, rgb };
}
