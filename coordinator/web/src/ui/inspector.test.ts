import { expect, test } from 'vitest';
import { exposureText } from './display-controls.ts';
import { fileSafe } from './inspector.ts';
import { statisticsRows } from './statistics.ts';

test('screenshots have names that every file system takes', () => {
  expect(['Job 8dedd6f2', '../../etc/passwd', 'Büro: "Süd"', '???', 'x'.repeat(200)].map(fileSafe)).toEqual(
    ['Job-8dedd6f2', 'etc-passwd', 'Büro-Süd', 'kiln', 'x'.repeat(80)]);
});

test('exposures have their sign', () => {
  expect([0, 1.25, -0.5].map(exposureText)).toEqual(['0.00 EV', '+1.25 EV', '−0.50 EV']);
});

test('figures that are not known are left out', () => {
  const stats = {
    fps: 0, frameMs: 1.25, drawCalls: 3, triangles: 82_000, textureBytes: 2 ** 20, budgetBytes: 2 ** 29, firstPictureMs: null, codec: 'pwl',
    schemes: { expanded: 7, mean: 1 }, busy: false,
  };
  const rows = Object.fromEntries(statisticsRows(stats));
  expect(rows['Frames per second']).toBe('at rest');
  expect([rows['First picture'], rows['On the way']]).toEqual([null, null]);
  expect(rows['Texture memory']).toBe('1.0 MiB of 512.0 MiB');
  expect(rows['Surfaces by scheme']).toBe('7 expanded, 1 mean');
});
