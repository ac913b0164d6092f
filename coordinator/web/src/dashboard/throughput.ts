/**
 * The last hour's work as curves and as a table. Pure: buckets in, paths and rows out.
 *
 * The coordinator may leave out buckets without work, so times decide where a point lies, and what is missing is zero.
 */

import type { Throughput } from '../live/records.ts';
import { clockTime } from '../ui/format.ts';

/** How far back the curves reach. */
export const SPAN_MS = 3_600_000;
/** What curves are a mean over; the rates of jobs and workers are, too. */
const SMOOTH_MS = 30_000;
/** Of the table's rows. */
const ROW_MS = 300_000;

export type Figure = 'rays' | 'texels';

/** A figure per second in each bucket of the hour before `now`, oldest first. */
export function series({ interval_ms, points }: Throughput, figure: Figure, now: number): number[] {
  const buckets = Math.round(SPAN_MS / interval_ms);
  const values = new Array<number>(buckets).fill(0);
  const first = Math.floor(now / interval_ms) - buckets + 1;
  for (const point of points) {
    const at = Math.floor(point.at_ms / interval_ms) - first;
    if (at >= 0 && at < buckets) values[at] += (point[figure] * 1000) / interval_ms;
  }
  return values;
}

/**
 * Each bucket's mean with those of the half minute before it: workers tell their rays with every heartbeat, which is less often than a
 * bucket.
 */
export function smooth(values: readonly number[], intervalMs: number): number[] {
  const width = Math.max(1, Math.round(SMOOTH_MS / intervalMs));
  let sum = 0;
  return values.map((value, i) => {
    sum += value - (i >= width ? values[i - width] : 0);
    return sum / width;
  });
}

/** A round number at or above the largest value: 1, 2 or 5 times a power of ten; 1 for a curve of zeros. */
export function ceiling(values: readonly number[]): number {
  const most = Math.max(...values, 0);
  if (most === 0) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  return ([1, 2, 5].find((k) => k * power >= most) ?? 10) * power;
}

/** The outline of a curve in a box of `width` x `height` with y downward, as the `d` of an SVG path; closed along the base line. */
export function areaPath(values: readonly number[], top: number, width: number, height: number): string {
  const step = width / Math.max(1, values.length - 1);
  const points = values.map((value, i) => `${round(i * step)},${round(height - (height * value) / top)}`);
  return `M0,${height}L${points.join('L')}L${width},${height}Z`;
}

const round = (value: number): number => Math.round(value * 100) / 100;

export interface TableRow {
  time: string;
  raysPerSecond: number;
  texelsPerSecond: number;
  tiles: number;
  /** Most at once. */
  workers: number;
}

/** The hour in rows of five minutes, youngest first; rows without work are left out. */
export function tableRows({ points }: Throughput, now: number): TableRow[] {
  const rows: TableRow[] = [];
  for (let end = now; end > now - SPAN_MS; end -= ROW_MS) {
    const inside = points.filter(({ at_ms }) => at_ms <= end && at_ms > end - ROW_MS);
    const sum = (figure: 'rays' | 'texels' | 'tiles') => inside.reduce((total, point) => total + point[figure], 0);
    if (sum('rays') + sum('tiles') === 0) continue;
    rows.push({
      time: `${clockTime(end - ROW_MS).slice(0, 5)}–${clockTime(end).slice(0, 5)}`,
      raysPerSecond: (sum('rays') * 1000) / ROW_MS,
      texelsPerSecond: (sum('texels') * 1000) / ROW_MS,
      tiles: sum('tiles'),
      workers: Math.max(...inside.map(({ workers }) => workers)),
    });
  }
  return rows;
}
