/** How pages speak of jobs: names, states, progress. Pure, and the same on the dashboard and on a job's page. */

import { type JobRecord, isFinal } from '../live/records.ts';
import { duration, percent } from './format.ts';

/** What a person calls the job: its label `name`, else its labels, else the end of its id. */
export function jobName({ id, labels }: Pick<JobRecord, 'id' | 'labels'>): string {
  if (labels.name) return labels.name;
  const pairs = Object.entries(labels).map(([key, value]) => (value ? `${key}: ${value}` : key));
  return pairs.length > 0 ? pairs.join(', ') : `Job ${id.slice(-8)}`;
}

/** State, with the phase while it bakes. */
export function stateText({ state, phase }: Pick<JobRecord, 'state' | 'phase'>): string {
  return state === 'baking' && phase ? `baking, ${phase === 'probe' ? 'probing' : 'all tiles'}` : state;
}

/** How far it is, in words: `42 %, 27 of 64 tiles, 3 min left`. */
export function progressText({ state, progress }: Pick<JobRecord, 'state' | 'progress'>): string {
  if (progress.tiles === 0 || state === 'queued' || state === 'preparing') return 'not begun';
  const parts = [percent(progress.fraction), `${progress.tiles_done} of ${progress.tiles} tiles`];
  if (!isFinal(state) && progress.eta_seconds !== null) parts.push(`${duration(progress.eta_seconds)} left in this phase`);
  return parts.join(', ');
}

/** How long it took, or takes until now; null before it began. */
export function elapsedText({ started_ms, finished_ms }: Pick<JobRecord, 'started_ms' | 'finished_ms'>, now: number): string | null {
  return started_ms === null ? null : duration(((finished_ms ?? now) - started_ms) / 1000);
}

/** A setting's value on one line. */
export function settingText(value: unknown): string {
  if (value === null) return 'none';
  if (typeof value !== 'object') return String(value);
  const entries = Object.entries(value);
  return entries.length === 0 ? 'none' : entries.map(([key, part]) => `${key} ${settingText(part)}`).join(', ');
}
