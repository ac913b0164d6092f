import { expect, test } from 'vitest';
import type { SurfacePlan } from '../format/plan.ts';
import { isCovered } from './covered.ts';

test('the tip of a narrow chart is covered beyond the reach of its last centre', () => {
  // The chart of proto::texel's own test: one texel wide, 20 long, its hypotenuse crosses the line of centres in the middle.
  const uv = Float32Array.from([8, 4, 9, 4, 8, 24], (v) => v / 32);
  const plan = { width: 32, height: 32, uv } as SurfacePlan;
  const covered: [number, number][] = [];
  for (let y = 0; y < 32; y++) {
    for (let x = 0; x < 32; x++) {
      if (isCovered(plan, x, y)) covered.push([x, y]);
    }
  }
  const rows = [...Array(10).keys()].map((k) => k + 4).concat([...Array(8).keys()].map((k) => k + 16));
  expect(covered).toEqual(rows.map((y) => [8, y]));
});
