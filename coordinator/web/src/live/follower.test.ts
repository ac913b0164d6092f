import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { JobFollower } from './follower.ts';
import type { JobRecord } from './records.ts';
import type { FollowState } from './state.ts';

/** The browser's EventSource, as far as it is used. */
class FakeSource extends EventTarget {
  static readonly CLOSED = 2;
  static all: FakeSource[] = [];
  readyState = 1;
  constructor(readonly url: string) {
    super();
    FakeSource.all.push(this);
  }
  close() {
    this.readyState = FakeSource.CLOSED;
  }
  tell(name: string, data: object, lastEventId = '') {
    this.dispatchEvent(Object.assign(new Event(name), { data: JSON.stringify(data), lastEventId }));
  }
}

/** The browser's Web Locks, as far as they are used: of all its windows. */
class FakeLocks {
  readonly held = new Set<string>();
  async request(name: string, _: object, work: (lock: object | null) => unknown): Promise<void> {
    if (this.held.has(name)) return void (await work(null));
    this.held.add(name);
    await work({});
    this.held.delete(name);
  }
}

let answer: (path: string) => Response;
let page: EventTarget & { hidden: boolean; baseURI: string };
let locks: FakeLocks;
let states: FollowState[];
let follower: JobFollower;
const job = (over: Partial<JobRecord>) => ({ id: '7', phase: 'bake', progress: { tiles: 9, tiles_done: 0 }, ...over }) as JobRecord;
const record = (over: Partial<JobRecord>) => () => Response.json(job(over));
const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const see = (hidden: boolean) => {
  page.hidden = hidden;
  page.dispatchEvent(new Event('visibilitychange'));
};
const open = () => FakeSource.all.filter(({ readyState }) => readyState !== FakeSource.CLOSED);
const tiles = (seq: number, start: number, end: number) => ({ seq, at_ms: 0, event: 'tiles', phase: 'bake', runs: [{ start, end }], tiles_done: end, tiles: 9 });

beforeEach(() => {
  vi.useFakeTimers();
  FakeSource.all = [];
  page = Object.assign(new EventTarget(), { hidden: false, baseURI: 'http://farm/' });
  locks = new FakeLocks();
  vi.stubGlobal('document', page);
  vi.stubGlobal('navigator', { locks });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('EventSource', FakeSource);
  vi.stubGlobal('fetch', async (url: string) => answer(url));
  answer = record({ state: 'baking' });
  states = [];
  follower = new JobFollower('7', (state) => states.push(state));
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

test('tiles come by events, from the beginning', async () => {
  follower.start();
  await pass(0);
  const [source] = FakeSource.all;
  expect(source.url).toBe('http://farm/v1/jobs/7/events?after=0');
  source.tell('tiles', tiles(1, 0, 3));
  source.tell('tiles', tiles(2, 5, 6));
  expect(follower.state.baked).toEqual([{ start: 0, end: 3 }, { start: 5, end: 6 }]);
});

test('a coordinator that goes away and comes back is heard again behind the last event', async () => {
  follower.start();
  await pass(0);
  FakeSource.all[0].tell('tiles', tiles(4, 0, 3));
  answer = () => {
    throw new TypeError('refused');
  };
  FakeSource.all[0].close();
  FakeSource.all[0].dispatchEvent(new Event('error'));
  await pass(10_000);
  expect(follower.state.awaySince).not.toBeNull();
  answer = record({ state: 'baking' });
  await pass(2_000);
  expect(follower.state.awaySince).toBeNull();
  expect(FakeSource.all.map(({ url }) => url)).toEqual(['http://farm/v1/jobs/7/events?after=0', 'http://farm/v1/jobs/7/events?after=4']);
});

test('a proxy that speaks for an absent coordinator is silence, not a refusal', async () => {
  answer = () => new Response('Bad Gateway', { status: 502 });
  follower.start();
  await pass(0);
  expect(follower.state.awaySince).not.toBeNull();
});

test('a job that is deleted while watched ends the stream', async () => {
  follower.start();
  await pass(0);
  answer = () => new Response('{"detail":"no such job"}', { status: 404, headers: { 'content-type': 'application/problem+json' } });
  await pass(2_000);
  expect([follower.state.gone, FakeSource.all[0].readyState]).toEqual(['deleted', FakeSource.CLOSED]);
});

test('an end that an event brings is completed by the record', async () => {
  follower.start();
  await pass(0);
  answer = record({ state: 'failed', problem: { message: 'out of disk' } });
  FakeSource.all[0].tell('state', { seq: 1, at_ms: 0, event: 'state', state: 'failed', phase: null });
  await pass(0);
  expect(states.at(-1)?.job?.problem?.message).toBe('out of disk');
  expect(FakeSource.all[0].readyState).toBe(FakeSource.CLOSED);
});

test('a snapshot continues the sequence that it stands for', async () => {
  follower.start();
  await pass(0);
  FakeSource.all[0].tell('snapshot', { job: job({ state: 'baking' }), phase: 'bake', runs: [{ start: 0, end: 8 }] }, '50');
  FakeSource.all[0].tell('tiles', tiles(51, 8, 9));
  expect([follower.state.seq, follower.state.baked]).toEqual([51, [{ start: 0, end: 9 }]]);
});

test('a hidden page holds no stream, and goes on behind the last event when it is shown', async () => {
  follower.start();
  await pass(0);
  FakeSource.all[0].tell('tiles', tiles(4, 0, 3));
  see(true);
  await pass(10_000);
  expect([open().length, locks.held.size]).toEqual([0, 0]);
  see(false);
  await pass(0);
  expect(open().map(({ url }) => url)).toEqual(['http://farm/v1/jobs/7/events?after=4']);
});

test('a page that is hidden while it waits for its slot opens no stream', async () => {
  follower.start();
  const request = vi.spyOn(locks, 'request').mockImplementationOnce(async (...args) => {
    await new Promise((done) => setTimeout(done, 100));
    request.mockRestore();
    await locks.request(...args);
  });
  await pass(50);
  see(true);
  await pass(10_000);
  expect([FakeSource.all.length, locks.held.size]).toEqual([0, 0]);
});

test('windows beyond the streams of a browser ask for the tiles, until a stream is free', async () => {
  const windows = [follower, ...[1, 2].map(() => new JobFollower('7', () => {}))];
  answer = (path) => (path.endsWith('/tiles') ? Response.json({ phase: 'bake', tiles_done: 3, runs: [{ start: 0, end: 3 }] }) : record({ state: 'baking' })());
  for (const window of windows) {
    window.start();
    await pass(0);
  }
  expect(open().length).toBe(2);
  expect(windows.map(({ state }) => state.baked)).toEqual([[], [], [{ start: 0, end: 3 }]]);
  // The first window's job is gone.
  answer = () => new Response(null, { status: 404 });
  windows[0].refresh();
  await pass(0);
  answer = record({ state: 'baking' });
  await pass(2_000);
  expect(open().length).toBe(2);
  expect(FakeSource.all.length).toBe(3);
});

test('where there are no Web Locks, each page that is shown has its stream', async () => {
  vi.stubGlobal('navigator', {});
  for (const window of [follower, ...[1, 2].map(() => new JobFollower('7', () => {}))]) window.start();
  await pass(0);
  expect(open().length).toBe(3);
});

test('a refusal is told in its words, and asked again', async () => {
  const problem = { status: 500, headers: { 'content-type': 'application/problem+json' } };
  answer = () => new Response('{"detail":"the store is damaged"}', problem);
  follower.start();
  await pass(0);
  expect([follower.state.refused, follower.state.awaySince]).toEqual(['the store is damaged', null]);
  answer = record({ state: 'baking' });
  await pass(2_000);
  expect([follower.state.refused, follower.state.job?.state]).toEqual([null, 'baking']);
});
