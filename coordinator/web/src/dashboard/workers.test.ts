import { expect, test } from 'vitest';
import type { WorkerRecord } from '../live/records.ts';
import { totals } from './workers.ts';

const worker = (over: Partial<WorkerRecord> = {}): WorkerRecord => ({
  id: '1', name: 'w', threads: 8, features: [], since_ms: 0, seen_ms: 0, job: null, texels_done: 1_000, rays: 2e6, core_seconds: 30, peak_rss_bytes: 0, ...over,
});

test('the farm is the sum of its workers', () => {
  const rows = Object.fromEntries(totals([worker({ job: 'x', rays_per_second: 1e6, texels_per_second: 50 }), worker({ rays_per_second: 5e5 })]));
  expect(rows).toMatchObject({
    Workers: '2 (1 baking)', Threads: '16', 'Rays now': '1.50 M/s', 'Texels now': '50/s', 'Rays traced': '4.00 M', 'Texels baked': '2.00 k', 'Processor time': '1 min',
  });
});

test('speeds that are not measured are left out, not told as zero', () => {
  expect(Object.fromEntries(totals([worker()]))['Rays now']).toBeNull();
});
