import { expect, test } from 'vitest';
import type { JobRecord } from '../live/records.ts';
import { INITIAL } from '../live/state.ts';
import { emptyText } from './emptiness.ts';

const at = (state: JobRecord['state']) => ({ ...INITIAL, job: { state } as JobRecord });

test('a job that ended without a package says that there is nothing, where it was not watched', () => {
  expect([emptyText(at('failed'), false), emptyText(at('cancelled'), false)].every((text) => text?.includes('not kept'))).toBe(true);
  expect([emptyText(at('failed'), true), emptyText(at('cancelled'), true)]).toEqual([null, null]);
});

test('where something may come, nothing is said', () => {
  expect([INITIAL, at('queued'), at('baking'), at('assembling'), at('done')].map((state) => emptyText(state, false))).toEqual([null, null, null, null, null]);
});

test('a job that is not there has nothing to show, and one that was watched stays', () => {
  expect(emptyText({ ...INITIAL, gone: 'unknown' }, false)).toBe('There is nothing to show.');
  expect(emptyText({ ...at('baking'), gone: 'deleted' }, true)).toBeNull();
});
