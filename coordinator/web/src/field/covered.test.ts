import { describe, expect, it } from 'vitest';
import { goldenRoom } from '../testing.ts';
import { type Covering, isCovered } from './covered.ts';

/** The chart of proto::texel's own test: one texel wide, 20 long, its hypotenuse crosses the line of centres in the middle. */
const NARROW = [8, 4, 9, 4, 8, 24];

/** A texture of 32 x 32 texels with these triangles, in texels; those of the numbers in `flat` have no area in the world. */
function covering(corners: number[], flat: number[] = []): Covering {
  const uv = Float32Array.from(corners, (v) => v / 32);
  const normals = Float32Array.from({ length: (uv.length / 2) * 3 }, (_, i) => Number(i % 3 === 2 && !flat.includes(Math.floor(i / 9))));
  return { plan: { width: 32, height: 32, uv }, geometry: { normals } };
}

function covered(surface: Covering): string[] {
  const texels = Array.from({ length: surface.plan.width * surface.plan.height }, (_, i) => [i % surface.plan.width, Math.floor(i / surface.plan.width)]);
  return texels.filter(([x, y]) => isCovered(surface, x, y)).map(String);
}

const rows = (from: number, to: number): string[] => Array.from({ length: to - from }, (_, k) => `8,${from + k}`);

describe('a texel', () => {
  it('is covered beyond the reach of the last centre, at the tip of a narrow chart', () => {
    expect(covered(covering(NARROW))).toEqual([...rows(4, 14), ...rows(16, 24)]);
  });

  it('is not covered by triangles that have no area in the texture', () => {
    const [line, point] = [[8, 24, 8.25, 26, 8.5, 28], [20.5, 8.5, 20.5, 8.5, 20.5, 8.5]];
    expect(covered(covering([...line, ...NARROW, ...point]))).toEqual(covered(covering(NARROW)));
  });

  it('is not covered by triangles that have no area in the world, under its centre or as a tip, nor is it their gutter', () => {
    const large = [6, 20, 12, 20, 6, 30];
    expect(covered(covering([...large, ...NARROW], [0]))).toEqual(covered(covering(NARROW)));
    expect(covered(covering(NARROW, [0]))).toEqual([]);
    expect(covered(covering([...large, ...NARROW]))).toContain('9,21');
  });

  it('of a package is covered where the coordinator counted it', () => {
    for (const surface of goldenRoom().surfaces) expect(covered(surface).length, surface.name).toBe(surface.plan.covered);
  });
});
