import { expect, test } from 'vitest';
import type { TexelSample } from '../viewer/api.ts';
import { describe as describeTexel } from './hemisphere.ts';

const sample = (over: Partial<TexelSample> = {}): TexelSample => {
  const radiance = new Float32Array(2 * 4 * 3).fill(0.25);
  radiance.set([2, 2, 2], 5 * 3);
  return {
    surface: 'floor', surfaceIndex: 0, part: 'floor', x: 3, y: 4, position: [0, 0, 0], grid: { nTheta: 2, nPhi: 4 }, coded: new Uint8Array(24),
    radiance, keptSamples: 6, view: { theta: 12.34, phi: 56.78 }, covered: true, ...over,
  };
};

test('a texel is told in words: place, samples, range, brightest direction, view', () => {
  expect(describeTexel(sample())).toBe(
    'Texel (3, 4) of floor: 6 of 8 samples kept; luminance from 0.25 to 2 W/(sr m²), brightest toward θ 67.5°, φ 90.0°; the ring marks the view, θ 12.3°, φ 56.8°.',
  );
});

test('a part is told where a surface has several, and which side it is', () => {
  expect(describeTexel(sample({ surface: 'atlas~back', part: 'leaf 7' }))).toContain('Texel (3, 4) of atlas~back, part leaf 7: 6 of 8');
});

test('a gutter texel is told from a covered one', () => {
  expect(describeTexel(sample({ covered: false }))).toContain('of floor, in the gutter:');
});
