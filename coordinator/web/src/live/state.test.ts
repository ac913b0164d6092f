import { expect, test } from 'vitest';
import type { JobEvent, JobRecord } from './records.ts';
import { INITIAL, type FollowState, type Input, apply, bakedTiles } from './state.ts';

const job = (over: Partial<JobRecord> = {}): JobRecord => ({
  id: '0198', scene: null, state: 'baking', phase: 'bake', settings: {}, priority: 0, labels: {}, problem: null, waiting: null,
  progress: { tiles: 10, tiles_done: 0, texels: 0, fraction: 0, rays: 0, rays_per_second: 0, workers: 1, eta_seconds: null },
  created_ms: 0, started_ms: 0, finished_ms: null, ...over,
});
const tiles = (seq: number, start: number, end: number, phase: 'probe' | 'bake' = 'bake'): Input => {
  return { kind: 'event', event: { seq, at_ms: 0, event: 'tiles', phase, runs: [{ start, end }], tiles_done: end, tiles: 10 } };
};
const after = (...inputs: Input[]): FollowState => inputs.reduce(apply, INITIAL);
const record = (over: Partial<JobRecord> = {}): Input => ({ kind: 'record', job: job(over) });

test('tiles of the Bake phase add up, those of Probe do not count', () => {
  const state = after(record(), tiles(1, 0, 4, 'probe'), tiles(2, 2, 4), tiles(3, 0, 2));
  expect(state.baked).toEqual([{ start: 0, end: 4 }]);
  expect(bakedTiles(state)).toBe(4);
  expect(state.job?.progress.tiles_done).toBe(4);
});

test('an event heard twice changes nothing', () => {
  const state = after(record(), tiles(5, 0, 4));
  expect(apply(state, tiles(5, 0, 4))).toBe(state);
  expect(apply(state, tiles(4, 6, 7))).toBe(state);
});

test('replayed history never carries a job backward', () => {
  const event = (seq: number, state: JobRecord['state'], phase: JobRecord['phase'] = null): Input => {
    return { kind: 'event', event: { seq, at_ms: 0, event: 'state', state, phase } as JobEvent };
  };
  const old = after(record({ state: 'baking', phase: 'bake' }), event(1, 'queued'), event(2, 'baking', 'probe'));
  expect([old.job?.state, old.job?.phase, old.seq]).toEqual(['baking', 'bake', 2]);
  expect(apply(old, event(3, 'assembling')).job?.state).toBe('assembling');
});

test('a job is paused and goes on where it was', () => {
  const event = (seq: number, state: JobRecord['state']): Input => {
    return { kind: 'event', event: { seq, at_ms: 0, event: 'state', state, phase: 'bake' } as JobEvent };
  };
  const paused = after(record(), event(1, 'paused'));
  expect(paused.job?.state).toBe('paused');
  expect(apply(paused, event(2, 'baking')).job?.state).toBe('baking');
});

test('an id that never was is told from a job that was deleted', () => {
  expect(after({ kind: 'not-found' }).gone).toBe('unknown');
  expect(after(record(), { kind: 'not-found' }).gone).toBe('deleted');
});

test('the first silence counts, and the first word ends it', () => {
  const away = after(record(), { kind: 'away', at: 1000 }, { kind: 'away', at: 3000 });
  expect(away.awaySince).toBe(1000);
  expect(apply(away, record()).awaySince).toBeNull();
  expect(apply(away, tiles(1, 0, 1)).awaySince).toBeNull();
});

test('a refusal is neither silence nor the end, and the next record ends it', () => {
  const refused = after(record(), { kind: 'away', at: 1000 }, { kind: 'refused', detail: 'busy' });
  expect([refused.awaySince, refused.refused, refused.gone, refused.job?.state]).toEqual([null, 'busy', null, 'baking']);
  expect(apply(refused, { kind: 'refused', detail: 'busy' })).toBe(refused);
  expect(apply(refused, { kind: 'away', at: 2000 }).refused).toBeNull();
  expect(apply(refused, { kind: 'not-found' }).refused).toBeNull();
  expect(apply(refused, record()).refused).toBeNull();
});

test('tiles that were asked for add to those of events, and leave the place in the stream', () => {
  const state = after(record(), tiles(3, 0, 4), { kind: 'tiles', phase: 'bake', runs: [{ start: 2, end: 6 }] });
  expect([state.baked, state.seq]).toEqual([[{ start: 0, end: 6 }], 3]);
  expect(apply(state, { kind: 'tiles', phase: 'probe', runs: [{ start: 8, end: 9 }] })).toBe(state);
});

test('a snapshot in the middle replaces what was known and says that events were missed', () => {
  const snapshot: Input = { kind: 'snapshot', seq: 90, snapshot: { job: job(), phase: 'bake', runs: [{ start: 3, end: 8 }] } };
  const first = after(record(), snapshot);
  expect([first.missed, first.seq, first.baked]).toEqual([false, 90, [{ start: 3, end: 8 }]]);
  expect(after(record(), tiles(1, 0, 1), snapshot).missed).toBe(true);
  expect(apply(first, tiles(91, 0, 3)).baked).toEqual([{ start: 0, end: 8 }]);
});

test('a finished job has all tiles, read or not', () => {
  expect(bakedTiles(after(record({ state: 'done', phase: null })))).toBe(10);
});
