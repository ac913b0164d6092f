/**
 * A surface's kept samples in memory: what `.mtsp`, `.mti`, `.mtnc` and `.mtm` hold, as typed arrays over the files' own bytes.
 *
 * Steps, not depths: `.mti` names samples by depth, every search along a texel wants the walk's order, so that the translation is made once
 * here. The files' bytes stay in memory (a fraction of what they expand to): the inspectors read texels from them, and lost WebGL contexts
 * are restored from them.
 */

import { FormatError } from './bytes.ts';
import { openFile } from './header.ts';
import type { Walk } from './plan.ts';
import { type Grid, directionCount, stepOfDepth } from '../field/grid.ts';

/** Kept samples of consecutive texels. */
export interface KeptSamples {
  /** Where each texel's samples begin; one more than texels. */
  starts: Uint32Array;
  /** Step of the walk of each sample, rising within a texel from 0 to D - 1. */
  steps: Uint16Array;
  /** Index into `map` of each sample, or null where `rgb` has the colours themselves. */
  indices: Uint16Array | null;
  /** Red, green, blue of each colour of the map, or of each sample. */
  rgb: Uint8Array;
}

export interface CodedSurface extends KeptSamples {
  width: number;
  height: number;
}

/** The bytes of the four files. */
export interface CodedFiles {
  mtsp: Uint8Array;
  mti: Uint8Array;
  mtnc: Uint8Array;
  mtm: Uint8Array;
}

/** Joins the four files of a surface. Throws a {@link FormatError} where one is damaged or they do not belong together. */
export function openCoded(files: CodedFiles, stem: string, expected: { width: number; height: number; grid: Grid; walk: Walk }): CodedSurface {
  const open = (kind: keyof CodedFiles) => openFile(files[kind], kind, `surfaces/${stem}.${kind}`);
  const [mtsp, mti, mtnc, mtm] = [open('mtsp'), open('mti'), open('mtnc'), open('mtm')];
  const bad = (what: string) => new FormatError(`surfaces/${stem}: ${what}`);
  const directions = directionCount(expected.grid);
  for (const { header } of [mtsp, mti, mtnc, mtm]) {
    if (header.width !== expected.width || header.height !== expected.height || header.depth !== directions) {
      throw bad('a file has another texture size or depth than the manifest says');
    }
  }
  if (mti.header.count !== mtnc.header.count) throw bad('.mti and .mtnc have different numbers of samples');
  const starts = words32(mtsp.payload);
  checkStarts(starts, expected.width * expected.height, mti.header.count, directions, bad);
  const steps = toSteps(words16(mti.payload), stepOfDepth(expected.grid, expected.walk), bad);
  checkSteps(starts, steps, directions, bad);
  const indices = mtnc.header.bits === 16 ? words16(mtnc.payload) : null;
  const rgb = indices ? mtm.payload : mtnc.payload;
  const colours = rgb.length / 3;
  if (indices?.some((i) => i >= colours)) throw bad('a colour index is beyond the colour map');
  return { width: expected.width, height: expected.height, starts, steps, indices, rgb };
}

/** A texel's samples must rise from step 0 to the last: what lies between two of them is their line. */
function checkSteps(starts: Uint32Array, steps: Uint16Array, directions: number, bad: (what: string) => Error): void {
  for (let t = 0; t + 1 < starts.length; t++) {
    const [from, to] = [starts[t], starts[t + 1]];
    if (from === to) continue;
    if (steps[from] !== 0 || steps[to - 1] !== directions - 1) throw bad(`texel ${t} lacks the first or last direction of its walk`);
    for (let k = from + 1; k < to; k++) {
      if (steps[k] <= steps[k - 1]) throw bad(`the samples of texel ${t} are out of order`);
    }
  }
}

function checkStarts(starts: Uint32Array, texels: number, samples: number, directions: number, bad: (what: string) => Error): void {
  if (starts.length !== texels + 1 || starts[0] !== 0 || starts[texels] !== samples) throw bad('.mtsp does not span the samples');
  for (let t = 0; t < texels; t++) {
    if (starts[t + 1] < starts[t] || starts[t + 1] - starts[t] > directions) throw bad('.mtsp goes down, or by more than there are directions');
  }
}

/** Depths to steps: a copy, since the bytes are the caller's. */
function toSteps(depths: Uint16Array, stepOf: Uint16Array, bad: (what: string) => Error): Uint16Array {
  const steps = new Uint16Array(depths.length);
  for (let i = 0; i < depths.length; i++) {
    if (depths[i] >= stepOf.length) throw bad(`a sample has depth ${depths[i]}; there are ${stepOf.length} directions`);
    steps[i] = stepOf[depths[i]];
  }
  return steps;
}

const LITTLE = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** A copy where alignment asks for one or, on a big-endian machine, the order of bytes; else a view. */
function aligned(bytes: Uint8Array, size: 2 | 4): ArrayBuffer {
  const copy = bytes.slice().buffer as ArrayBuffer;
  if (!LITTLE) {
    const b = new Uint8Array(copy);
    for (let i = 0; i + size <= b.length; i += size) b.subarray(i, i + size).reverse();
  }
  return copy;
}

function words32(bytes: Uint8Array): Uint32Array {
  return LITTLE && bytes.byteOffset % 4 === 0
    ? new Uint32Array(bytes.buffer as ArrayBuffer, bytes.byteOffset, bytes.length / 4)
    : new Uint32Array(aligned(bytes, 4));
}

function words16(bytes: Uint8Array): Uint16Array {
  return LITTLE && bytes.byteOffset % 2 === 0
    ? new Uint16Array(bytes.buffer as ArrayBuffer, bytes.byteOffset, bytes.length / 2)
    : new Uint16Array(aligned(bytes, 2));
}
