import { expect, test } from 'vitest';
import { count } from './runs.ts';
import { SegmentQueue } from './segment-queue.ts';

const all = (n: number) => [{ start: 0, end: n }];

test('nothing is asked for twice while it is under way', () => {
  const queue = new SegmentQueue();
  expect(queue.next(all(10))).toEqual(all(10));
  expect(queue.next(all(10))).toBeNull();
  expect(queue.next(all(12))).toEqual([{ start: 10, end: 12 }]);
});

test('what a body did not hold is asked for again', () => {
  const queue = new SegmentQueue();
  const asked = queue.next(all(5))!;
  queue.settle(asked, [0, 1, 4]);
  expect(queue.next(all(5))).toEqual([{ start: 2, end: 4 }]);
});

test('a failed request leaves its tiles wanted', () => {
  const queue = new SegmentQueue();
  queue.settle(queue.next(all(5))!, []);
  expect(queue.next(all(5))).toEqual(all(5));
});

test('a large job comes in several requests that cover it', () => {
  const queue = new SegmentQueue();
  let seen = 0;
  for (let runs = queue.next(all(1000)); runs; runs = queue.next(all(1000))) seen += count(runs);
  expect(seen).toBe(1000);
});
