import { DataUtils } from 'three';
import { expect, it } from 'vitest';
import { halves } from './raw.ts';

const coded = (linear: number) => 255 * (linear <= 0.0031308 ? linear * 12.92 : 1.055 * Math.min(1, linear) ** (1 / 2.4) - 0.055);

it('linear radiance keeps its precision where it shows, at any exposure', () => {
  for (const stops of [-40, -18, 0, 14, 30]) {
    const factor = 2 ** stops;
    const shown = Float32Array.from({ length: 300 }, (_, k) => (k + 1) / 300);
    const radiance = shown.map((v) => v / factor);
    const out = halves(radiance, Uint8Array.of(1), 100, factor);
    for (let k = 0; k < 300; k++) {
      const stored = DataUtils.fromHalfFloat(out[Math.floor(k / 3) * 4 + (k % 3)]);
      expect(Math.abs(coded(stored) - coded(shown[k])), `stop ${stops}, value ${shown[k]}`).toBeLessThan(0.2);
    }
  }
});

it('what is too bright is cut, and what holds no light is empty', () => {
  const out = halves(Float32Array.of(1e9, 1, 0, 5, 5, 5), Uint8Array.of(1, 0), 1, 1);
  expect([...out].map((h) => DataUtils.fromHalfFloat(h))).toEqual([65504, 1, 0, 1, 0, 0, 0, 0]);
});
