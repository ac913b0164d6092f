import { expect, test } from 'vitest';
import { bytes, clockTime, dateTime, duration, percent, radiance, rate, short } from './format.ts';
import { elapsedText, jobName, progressText, settingText, stateText } from './job-text.ts';

test('numbers keep three digits and never round up to a thousand', () => {
  expect([0, 7, 999, 999.6, 1234, 12_345, 123_456, 999_499, 999_500, 2.5e9].map(short)).toEqual(
    ['0', '7', '999', '1.00 k', '1.23 k', '12.3 k', '123 k', '999 k', '1.00 M', '2.50 G']);
  expect([rate(0), rate(undefined), rate(1.5e6)]).toEqual(['–', '–', '1.50 M/s']);
});

test('bytes have binary prefixes', () => {
  expect([0, 1023, 1024, 1536 * 1024, 1024 ** 2 - 1].map(bytes)).toEqual(['0 B', '1023 B', '1.0 KiB', '1.5 MiB', '1.0 MiB']);
});

test('only what is complete is at 100 %', () => {
  expect([-1, 0, 0.29, 0.999999, 1, 2].map(percent)).toEqual(['0 %', '0 %', '29 %', '99 %', '100 %', '100 %']);
});

test('durations have two parts at most', () => {
  expect([0, 59.4, 59.6, 60, 200, 3600, 7500].map(duration)).toEqual(['0 s', '59 s', '1 min', '1 min', '3 min 20 s', '1 h', '2 h 5 min']);
});

test('times are local and padded', () => {
  const at = new Date(2026, 0, 2, 3, 4, 5).getTime();
  expect([clockTime(at), dateTime(at)]).toEqual(['03:04:05', '2026-01-02 03:04']);
});

test('radiance keeps four digits over its whole range', () => {
  expect([0, 0.5, 12.3456, 1e-5, 123456].map(radiance)).toEqual(['0', '0.5', '12.35', '1.00e-5', '1.23e+5']);
});

test('a job is called by its label, else by the end of its id', () => {
  const id = '01a20f27-46b7-702b-b3f2-7a6f8dedd6f2';
  expect(jobName({ id, labels: { name: 'Atrium', x: 'y' } })).toBe('Atrium');
  expect(jobName({ id, labels: { project: 'atrium', draft: '' } })).toBe('project: atrium, draft');
  expect(jobName({ id, labels: {} })).toBe('Job 8dedd6f2');
});

test('state and progress are told in words', () => {
  const progress = { tiles: 64, tiles_done: 27, texels: 0, fraction: 0.42, rays: 0, rays_per_second: 0, workers: 1, eta_seconds: 200 };
  expect(stateText({ state: 'baking', phase: 'probe' })).toBe('baking, probing');
  expect(stateText({ state: 'done', phase: null })).toBe('done');
  expect(progressText({ state: 'baking', progress })).toBe('42 %, 27 of 64 tiles, 3 min 20 s left in this phase');
  expect(progressText({ state: 'cancelled', progress })).toBe('42 %, 27 of 64 tiles');
  expect(progressText({ state: 'queued', progress })).toBe('not begun');
  expect(progressText({ state: 'cancelled', progress: { ...progress, tiles: 0, tiles_done: 0 } })).toBe('not begun');
  expect(elapsedText({ started_ms: null, finished_ms: null }, 5)).toBeNull();
  expect(elapsedText({ started_ms: 1000, finished_ms: null }, 61_000)).toBe('1 min');
});

test('settings are one line each', () => {
  expect(settingText({ rule: 'bounded', eps: 2 })).toBe('rule bounded, eps 2');
  expect([settingText(null), settingText({}), settingText('20x20')]).toEqual(['none', 'none', '20x20']);
});
