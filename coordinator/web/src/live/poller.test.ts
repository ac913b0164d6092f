import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { Poller } from './poller.ts';

let page: EventTarget & { hidden: boolean };
const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const see = (hidden: boolean) => {
  page.hidden = hidden;
  page.dispatchEvent(new Event('visibilitychange'));
};

beforeEach(() => {
  vi.useFakeTimers();
  page = Object.assign(new EventTarget(), { hidden: false });
  vi.stubGlobal('document', page);
  vi.stubGlobal('window', globalThis);
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

test('it works at once, and again after each pause', async () => {
  const work = vi.fn(async () => 1_000);
  new Poller(work).start();
  expect(work).toHaveBeenCalledTimes(1);
  await pass(2_500);
  expect(work).toHaveBeenCalledTimes(3);
});

test('a hidden page asks nothing, and asks at once when it is shown', async () => {
  const work = vi.fn(async () => 1_000);
  new Poller(work).start();
  see(true);
  await pass(60_000);
  expect(work).toHaveBeenCalledTimes(1);
  see(false);
  expect(work).toHaveBeenCalledTimes(2);
  await pass(1_500);
  expect(work).toHaveBeenCalledTimes(3);
});

test('work never overlaps; what is wanted meanwhile follows at once', async () => {
  let running = 0;
  let most = 0;
  const work = vi.fn(async () => {
    most = Math.max(most, ++running);
    await new Promise((done) => setTimeout(done, 500));
    running--;
    return 60_000;
  });
  const poller = new Poller(work);
  poller.start();
  await pass(100);
  poller.soon();
  poller.soon();
  await pass(600);
  expect([work.mock.calls.length, most]).toEqual([2, 1]);
  await pass(10_000);
  expect(work).toHaveBeenCalledTimes(2);
});

test('after a stop nothing happens', async () => {
  const work = vi.fn(async () => 1_000);
  const poller = new Poller(work);
  poller.start();
  poller.stop();
  await pass(10_000);
  see(false);
  expect(work).toHaveBeenCalledTimes(1);
});
