import { expect, it } from 'vitest';
import { fitChannels, halve } from './channels.ts';
import { sortBackToFront } from './sorting.ts';

/** Triangles of 1 cm at these places along x. */
const along = (places: number[]) => Float32Array.from(places.flatMap((x) => [x, 0, 0, x + 0.01, 0, 0, x, 0.01, 0]));

function sorted(places: number[], triangles: number[], eye: [number, number, number]): number[] {
  const index = new Uint32Array(triangles.length * 3);
  sortBackToFront(Uint32Array.from(triangles), along(places), eye, index);
  expect([...index].filter((_, i) => i % 3 === 2).map((v) => v - 2)).toEqual([...index].filter((_, i) => i % 3 === 0));
  return [...index].filter((_, i) => i % 3 === 0).map((v) => v / 3);
}

it('what is blended is drawn from the farthest to the nearest, from every eye', () => {
  expect(sorted([3, 1, 2], [0, 1, 2], [0, 0, 0])).toEqual([0, 2, 1]);
  expect(sorted([3, 1, 2], [0, 1, 2], [10, 0, 0])).toEqual([1, 2, 0]);
  expect(sorted([3, 1, 2, 9], [2, 0], [0, 0, 0])).toEqual([0, 2]);
  expect(sorted([1, 1], [0, 1], [5, 0, 0])).toEqual([0, 1]);
  const places = Array.from({ length: 500 }, (_, i) => (i * 7919) % 1009);
  const order = sorted(places, [...places.keys()], [-1, 0, 0]);
  expect(order.map((t) => places[t])).toEqual([...places].sort((a, b) => b - a));
});

it('opacities are halved until they fit, the largest first', () => {
  const images = [{ width: 64, height: 64, each: 1 }, { width: 32, height: 16, each: 1 }] as const;
  expect(fitChannels([...images], 1e6, 2048)).toEqual([0, 0]);
  expect(fitChannels([...images], 2000, 2048)).toEqual([1, 0]);
  expect(fitChannels([...images], 1, 2048)).toEqual([6, 5]);
  expect(fitChannels([{ width: 5000, height: 10, each: 1 }], 1e9, 2048)).toEqual([2]);
  // A colour counts four times.
  expect(fitChannels([{ width: 32, height: 32, each: 4 }, { width: 32, height: 32, each: 1 }], 2048, 2048)).toEqual([1, 0]);
  expect(fitChannels([], 0, 2048)).toEqual([]);
});

it('half an opacity is the mean of four', () => {
  const one = { each: 1, srgb: false } as const;
  expect([...halve({ ...one, width: 2, height: 2, bytes: Uint8Array.of(0, 255, 255, 0) }).bytes]).toEqual([128]);
  expect(halve({ ...one, width: 1, height: 4, bytes: Uint8Array.of(0, 0, 200, 100) })).toEqual({ ...one, width: 1, height: 2, bytes: Uint8Array.of(0, 150) });
  const colours = Uint8Array.of(0, 10, 20, 255, 100, 30, 40, 255);
  expect([...halve({ each: 4, srgb: true, width: 2, height: 1, bytes: colours }).bytes]).toEqual([50, 20, 30, 255]);
});
