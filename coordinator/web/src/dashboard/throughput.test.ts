import { expect, test } from 'vitest';
import { SPAN_MS, areaPath, ceiling, series, smooth, tableRows } from './throughput.ts';

const NOW = 1_800_000_000_000;
const point = (before: number, rays: number) => ({ at_ms: NOW - before, rays, texels: rays / 10, tiles: 1, workers: 2 });

test('buckets that are missing are zero, and rates are per second', () => {
  const values = series({ interval_ms: 5_000, points: [point(0, 500), point(10_000, 1_000)] }, 'rays', NOW);
  expect(values.length).toBe(720);
  expect(values.slice(-3)).toEqual([200, 0, 100]);
  expect(values.slice(0, -3).every((v) => v === 0)).toBe(true);
});

test('what is older than the hour, or in the future, is not drawn', () => {
  const values = series({ interval_ms: 5_000, points: [point(SPAN_MS + 5_000, 9), point(-60_000, 9)] }, 'texels', NOW);
  expect(values.reduce((a, b) => a + b)).toBe(0);
});

test('work that is told in bursts is spread over half a minute, and none of it is lost', () => {
  const values = smooth([0, 0, 60, 0, 0, 0, 0, 0, 0, 0], 5_000);
  expect(values).toEqual([0, 0, 10, 10, 10, 10, 10, 10, 0, 0]);
});

test('scales end at round numbers', () => {
  expect([[0], [1], [1.1, 0], [3], [7], [1_234_567], []].map(ceiling)).toEqual([1, 1, 2, 5, 10, 2_000_000, 1]);
});

test('a curve stays in its box and ends on the base line', () => {
  expect(areaPath([0, 5, 10], 10, 100, 40)).toBe('M0,40L0,40L50,20L100,0L100,40Z');
});

test('the table has a row for each five minutes with work', () => {
  const rows = tableRows({ interval_ms: 5_000, points: [point(0, 300), point(1_000, 300), point(400_000, 600)] }, NOW);
  expect(rows.map(({ raysPerSecond, texelsPerSecond, tiles, workers }) => [raysPerSecond, texelsPerSecond, tiles, workers])).toEqual([
    [2, 0.2, 2, 2],
    [2, 0.2, 1, 2],
  ]);
  expect(rows[0].time).toMatch(/^\d\d:\d\d–\d\d:\d\d$/);
});
