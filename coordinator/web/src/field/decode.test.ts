import { describe, expect, it } from 'vitest';
import type { KeptSamples } from '../format/coded.ts';
import { between, decodeRow, expandBlock, sliceKept } from './decode.ts';
import { cosineWeights, depthOfStep } from './grid.ts';

/** Rows of (step, grey) pairs. */
function kept(rows: [number, number][][]): KeptSamples {
  const starts = new Uint32Array(rows.length + 1);
  rows.forEach((row, i) => (starts[i + 1] = starts[i] + row.length));
  const flat = rows.flat();
  return { starts, steps: Uint16Array.from(flat, ([s]) => s), indices: null, rgb: Uint8Array.from(flat.flatMap(([, v]) => [v, 255 - v, 7])) };
}

describe('the line between two kept samples', () => {
  it('is the rounded rational number for every pair of ends and every length', () => {
    const bytes = new Uint8Array(64 * 3);
    const wrong: number[][] = [];
    for (const length of [1, 2, 3, 7, 19, 63]) {
      for (let a = 0; a < 256; a += 5) {
        for (let b = 0; b < 256; b += 3) {
          decodeRow(kept([[[0, a], [length, b]]]), 0, bytes);
          for (let t = 0; t <= length; t++) {
            const exact = BigInt(2 * a * length + 2 * (b - a) * t + length) / BigInt(2 * length);
            if (bytes[t * 3] !== Number(exact) || between(a, b, t, length) !== Number(exact)) wrong.push([a, b, t, length]);
          }
        }
      }
    }
    expect(wrong).toEqual([]);
  });
});

describe('a block', () => {
  const grid = { nTheta: 2, nPhi: 2 };
  const [depthOf, weights] = [depthOfStep(grid, 'theta'), cosineWeights(grid)];

  it('has layers by depth, and alpha only where texels hold light', () => {
    const block = { x: 0, y: 0, width: 2, height: 1, rowOf: null, kept: kept([[], [[0, 10], [3, 40]]]) };
    const { layers, mean } = expandBlock(block, depthOf, weights, true);
    // Steps 0..3 are depths 0, 2, 1, 3 where inclinations come first.
    const red = (depth: number, texel: number) => layers![(depth * 2 + texel) * 4];
    expect([0, 1, 2, 3].map((depth) => red(depth, 1))).toEqual([10, 30, 20, 40]);
    expect([0, 1, 2, 3].map((depth) => red(depth, 0))).toEqual([0, 0, 0, 0]);
    expect([layers![3], layers![7]]).toEqual([0, 255]);
    expect([mean[3], mean[7]]).toEqual([0, 1]);
  });

  it('has as mean of a constant hemisphere that constant', () => {
    const block = { x: 0, y: 0, width: 1, height: 1, rowOf: null, kept: kept([[[0, 255], [3, 255]]]) };
    expect(expandBlock(block, depthOf, weights, false).mean[0]).toBeCloseTo(1, 6);
  });

  it('cut out of a surface decodes to the same', () => {
    const all = kept([[[0, 1], [3, 9]], [], [[0, 50], [1, 3], [3, 200]]]);
    const part = sliceKept(all, 1, 3);
    const [a, b] = [new Uint8Array(12), new Uint8Array(12)];
    decodeRow(all, 2, a);
    decodeRow(part, 1, b);
    expect(b).toEqual(a);
    expect([...part.starts]).toEqual([0, 0, 3]);
  });
});
