import { expect, it } from 'vitest';
import { ByteWriter } from '../testing.ts';
import { ByteReader } from './bytes.ts';
import { readEnvironment } from './environment.ts';

function environment(width: number, height: number, texel: (x: number, y: number) => number, texels = width * height) {
  const w = new ByteWriter().text('sky.hdr').varint(width, height, texels);
  for (let i = 0; i < texels; i++) w.f32(texel(i % width, Math.floor(i / width)), 1, 2);
  return readEnvironment(new ByteReader(w.f32(0.5, 10).bytes, 'scene.kiln'));
}

it('a small environment is kept as it is, its factor multiplied in', () => {
  const found = environment(2, 2, (x, y) => x + 2 * y);
  expect(found).toMatchObject({ name: 'sky.hdr', width: 2, height: 2, rotation: 0.5 });
  expect([...found.texels]).toEqual([0, 10, 20, 10, 10, 20, 20, 10, 20, 30, 10, 20]);
  found.mean.forEach((v, c) => expect(v).toBeCloseTo([15, 10, 20][c]));
});

it('a large one becomes the means of what falls together', () => {
  const found = environment(6000, 2, (x) => x / 6000);
  expect([found.width, found.height, found.texels.length]).toEqual([2048, 2, 2048 * 2 * 3]);
  const red = [...found.texels.filter((_, i) => i % 3 === 0).subarray(0, 2048)];
  expect(red).toEqual([...red].sort((a, b) => a - b));
  // Two or three texels each, none left out: the first are x = 0 to 2, the last 5998 and 5999.
  expect(red[0]).toBeCloseTo(10 / 6000, 6);
  expect(red[2047]).toBeCloseTo((10 * 5998.5) / 6000, 5);
});

it('the mean is that over the sphere: rows at the poles count less', () => {
  const { mean } = environment(1, 3, (_, y) => (y === 1 ? 0 : 1));
  expect(mean[0]).toBeCloseTo(5);
});

it('one of another size than it says, or of none, is refused', () => {
  expect(() => environment(2, 2, () => 0, 3)).toThrow('3 texels; 2 x 2 expected');
  expect(() => environment(0, 2, () => 0, 0)).toThrow('0 texels');
});
