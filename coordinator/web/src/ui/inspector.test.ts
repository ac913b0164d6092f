import { expect, test } from 'vitest';
import { exposureText, rawReason } from './display-controls.ts';
import { fileSafe } from './inspector.ts';
import { statisticsRows } from './statistics.ts';

test('screenshots have names that every file system takes', () => {
  expect(['Job 8dedd6f2', '../../etc/passwd', 'Büro: "Süd"', '???', 'x'.repeat(200)].map(fileSafe)).toEqual(
    ['Job-8dedd6f2', 'etc-passwd', 'Büro-Süd', 'kiln', 'x'.repeat(80)]);
});

test('exposures have their sign', () => {
  expect([0, 1.25, -0.5].map(exposureText)).toEqual(['0.00 EV', '+1.25 EV', '−0.50 EV']);
});

test('what needs raw radiance says why it cannot be had', () => {
  expect(rawReason({ hasRaw: false, live: false }, 'Raw')).toBe('Raw needs raw radiance, which this package did not keep.');
  expect(rawReason({ hasRaw: false, live: true }, 'The error')).toContain('when the job is done');
  expect([rawReason({ hasRaw: true, live: false }, 'Raw'), rawReason(null, 'Raw')]).toEqual([null, null]);
});

test('figures that are not known are left out', () => {
  const stats = {
    fps: 0, frameMs: 1.25, drawCalls: 3, triangles: 82_000, textureBytes: 2 ** 20, budgetBytes: 2 ** 29, firstPictureMs: null, codec: 'pwl',
    schemes: { expanded: 7, mean: 1 }, busy: false,
  };
  const rows = Object.fromEntries(statisticsRows(stats));
  expect(rows['Frames per second']).toBe('at rest');
  expect([rows['First picture'], rows['Samples']]).toEqual([null, null]);
  expect(Object.fromEntries(statisticsRows({ ...stats, busy: true }))['Samples']).toBe('loading…');
  expect(rows['Texture memory']).toBe('1.0 MiB of 512.0 MiB');
  expect(rows['Surfaces by scheme']).toBe('7 expanded, 1 mean');
});
