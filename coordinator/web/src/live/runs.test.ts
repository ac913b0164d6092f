import { expect, test } from 'vitest';
import { count, countWithin, formatRuns, fromTiles, minus, take, union } from './runs.ts';

const runs = (...pairs: [number, number][]) => pairs.map(([start, end]) => ({ start, end }));

test('a union is sorted, and neighbours become one run', () => {
  expect(union(runs([5, 7]), runs([0, 2], [2, 4], [6, 9], [3, 3]))).toEqual(runs([0, 4], [5, 9]));
});

test('a union leaves its arguments as they were', () => {
  const a = runs([0, 2]);
  union(a, runs([1, 5]));
  expect(a).toEqual(runs([0, 2]));
});

test('what is taken away leaves the rest, as a set of numbers would', () => {
  const all = (r: { start: number; end: number }[]) => r.flatMap(({ start, end }) => Array.from({ length: end - start }, (_, i) => start + i));
  const from = runs([0, 10], [12, 20], [30, 31]);
  for (const gone of [runs(), runs([0, 40]), runs([3, 5], [9, 13]), runs([12, 20]), runs([1, 2], [4, 5], [19, 31]), runs([31, 50])]) {
    const taken = new Set(all(gone));
    expect(all(minus(from, gone))).toEqual(all(from).filter((t) => !taken.has(t)));
  }
});

test('counts of a surface are those of its tiles', () => {
  const done = runs([0, 3], [5, 9]);
  expect(count(done)).toBe(7);
  expect(countWithin(done, 2, 4)).toBe(2);
  expect(countWithin(done, 9, 4)).toBe(0);
});

test('a request takes no more than its tiles and runs', () => {
  expect(take(runs([0, 3], [5, 9], [10, 20]), 5, 9)).toEqual(runs([0, 3], [5, 7]));
  expect(take(runs([0, 3], [5, 9], [10, 20]), 50, 2)).toEqual(runs([0, 3], [5, 9]));
});

test('runs are named by first and last tile', () => {
  expect(formatRuns(fromTiles([12, 3, 1, 2, 0]))).toBe('0-3,12');
});
