import { expect, test } from 'vitest';
import { messageFor } from './messages.ts';
import type { JobRecord } from './records.ts';
import { INITIAL, type FollowState } from './state.ts';

const job = (over: Partial<JobRecord>): JobRecord => ({ state: 'baking', phase: 'bake', waiting: null, problem: null, ...over }) as JobRecord;
const say = (state: Partial<FollowState>) => messageFor({ ...INITIAL, ...state }, 2);

test('nothing is said of a job that goes well', () => {
  expect(say({ job: job({}) })).toBeNull();
  expect(say({ job: job({ state: 'done', phase: null }) })).toBeNull();
});

test('a failure is told in the words of the coordinator', () => {
  const message = say({ job: job({ state: 'failed', problem: { message: 'index 9 of 8', file: 'a.obj', line: 3 } }) });
  expect(message).toEqual({ role: 'alert', text: 'The job failed. a.obj:3: index 9 of 8' });
});

test('each end has its own sentence', () => {
  const sentences = [
    say({ gone: 'unknown' }),
    say({ gone: 'deleted', job: job({}) }),
    say({ awaySince: 0 }),
    say({ refused: 'busy' }),
    say({ job: job({ state: 'failed' }) }),
    say({ job: job({ state: 'cancelled' }) }),
    say({ job: job({ waiting: 'no worker is connected' }) }),
    say({ job: job({}), missed: true }),
  ];
  expect(sentences.every((m) => m !== null)).toBe(true);
  expect(new Set(sentences.map((m) => m?.text)).size).toBe(sentences.length);
});

test('that a job is gone outweighs that it waits', () => {
  expect(say({ gone: 'deleted', job: job({ waiting: 'x' }) })?.text).toContain('deleted');
});

test('a refusal is told in the words of the coordinator', () => {
  expect(say({ job: job({}), refused: 'the store is read-only' })).toEqual({
    role: 'alert', text: 'The coordinator refuses to tell how this job is, and is asked again every 2 s: the store is read-only',
  });
});

test('silence is told with its beginning and what happens next', () => {
  expect(say({ awaySince: new Date(2026, 0, 1, 9, 5, 7).getTime() })?.text).toContain('does not answer since 09:05:07; trying again every 2 s');
});
