/** Segments of finished tiles, as `GET /v1/jobs/{id}/segments` sends them for the live preview (docs/formats.md). */

import { ByteReader } from './bytes.ts';
import type { KeptSamples } from './coded.ts';
import type { Walk } from './plan.ts';
import { crc32c } from './crc32c.ts';
import { type Grid, directionCount } from '../field/grid.ts';

export const TILE_SIDE = 32;

export interface TileSegment {
  /** Its number in the Bake phase. */
  tile: number;
  surface: number;
  cellX: number;
  cellY: number;
  grid: Grid;
  walk: Walk;
  /** Row of each of the 32 x 32 texels in `kept`, -1 where the texel holds no light. */
  rowOf: Int16Array;
  /** One bit a texel, 32 words by row: those that lie on a chart. */
  covered: Uint32Array;
  kept: KeptSamples;
}

/** Reads the body of a segments answer. */
export function parseSegments(body: Uint8Array): TileSegment[] {
  const r = new ByteReader(body, 'segments');
  const out: TileSegment[] = [];
  while (r.left > 0) {
    const tile = r.u64('tile');
    const segment = parseSegment(r.take(r.u32('length'), 'segment'));
    if (segment.tile !== tile) throw r.error(`the segment of tile ${tile} says that it is of tile ${segment.tile}`);
    out.push(segment);
  }
  return out;
}

/** Reads one KSEG of the Bake phase. */
export function parseSegment(bytes: Uint8Array): TileSegment {
  const r = new ByteReader(bytes, 'segment');
  if (String.fromCharCode(...r.take(4, 'header')) !== 'KSEG' || r.u16('version') !== 1) throw r.error('it is no segment of version 1');
  if (r.u8('kind') !== 2 || r.u8('phase') !== 1) throw r.error('it is not of a baked tile');
  const tile = r.u64('tile');
  const surface = r.u32('surface');
  const [cellX, cellY, nTheta, nPhi] = [r.u16('cell'), r.u16('cell'), r.u16('grid'), r.u16('grid')];
  const rows = r.u32('rows');
  const walk: Walk = (r.u16('flags') & 1) === 1 ? 'theta' : 'phi';
  r.skip(2, 'header');
  const crc = r.u32('checksum');
  if (crc32c(bytes.subarray(40), crc32c(bytes.subarray(0, 36))) !== crc) throw r.error('its checksum does not fit: it is damaged');
  const grid = { nTheta, nPhi };
  const { covered, rowOf, count } = readMasks(r);
  if (count !== rows) throw r.error(`it has ${rows} rows for ${count} texels`);
  r.skip(r.u16('errors') * 5 + 8, 'errors');
  return { tile, surface, cellX, cellY, grid, walk, rowOf, covered, kept: readRows(r, rows, directionCount(grid)) };
}

function readMasks(r: ByteReader): { covered: Uint32Array; rowOf: Int16Array; count: number } {
  const words = Uint32Array.from({ length: 2 * TILE_SIDE }, () => r.u32('masks'));
  const rowOf = new Int16Array(TILE_SIDE * TILE_SIDE).fill(-1);
  let count = 0;
  for (let y = 0; y < TILE_SIDE; y++) {
    for (let x = 0; x < TILE_SIDE; x++) {
      if (((words[y] | words[TILE_SIDE + y]) >>> x) & 1) rowOf[y * TILE_SIDE + x] = count++;
    }
  }
  return { covered: words.slice(0, TILE_SIDE), rowOf, count };
}

function readRows(r: ByteReader, rows: number, directions: number): KeptSamples {
  const starts = new Uint32Array(rows + 1);
  // As many as there can be (1,024 x 4,096 at most), cut to what there are at the end: growing arrays element by element is slower.
  const steps = new Uint16Array(rows * directions);
  const rgb = new Uint8Array(rows * directions * 3);
  for (let row = 0; row < rows; row++) {
    const n = r.u16('kept samples');
    if (n < 2 || n > directions) throw r.error(`row ${row} keeps ${n} samples of ${directions}`);
    starts[row + 1] = starts[row] + n;
    for (let k = 1, step = 0; k < n; k++) steps[starts[row] + k] = step += gap(r);
    if (steps[starts[row] + n - 1] !== directions - 1) throw r.error(`the last sample of row ${row} is not the last direction`);
    const at = starts[row] * 3;
    for (let c = 0; c < 3; c++) {
      const plane = r.take(n, 'kept samples');
      for (let k = 0, v = 0; k < n; k++) rgb[at + k * 3 + c] = v = (v + plane[k]) & 255;
    }
  }
  return { starts, steps: steps.slice(0, starts[rows]), indices: null, rgb: rgb.slice(0, starts[rows] * 3) };
}

/** Steps between two kept samples: one byte below 128, else two. */
function gap(r: ByteReader): number {
  const low = r.u8('kept samples');
  const steps = low < 128 ? low : (r.u8('kept samples') << 7) | (low - 128);
  if (steps === 0) throw r.error('two kept samples have the same direction');
  return steps;
}
