import { expect, test } from 'vitest';
import type { SurfaceModel } from '../viewer/api.ts';
import { surfaceCells } from './surfaces.ts';

const surface: SurfaceModel = {
  name: 'floor', backOf: null, parts: [], fileStem: 'floor', width: 64, height: 32, covered: 1, triangles: 2, firstTile: 10, tileCount: 4, scheme: null, gpuBytes: 2048,
  ratio: null, averageError: null, maxError: null,
};

test('a surface that bakes shows which of its tiles are done, and no figures of an encoding', () => {
  expect(surfaceCells(surface, [{ start: 0, end: 12 }])).toEqual(['64 × 32', '2 of 4', 'not yet', '2.0 KiB', '–', '–', '–']);
});

test('a package is complete', () => {
  const coded = { ...surface, scheme: 'expanded', ratio: 11.26, averageError: 0.345, maxError: 2 } as const;
  expect(surfaceCells(coded, null)).toEqual(['64 × 32', '4 of 4', 'expanded', '2.0 KiB', '11.3 : 1', '0.34/255', '2/255']);
});
