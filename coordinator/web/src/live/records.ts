/**
 * What the coordinator answers, as far as the pages read it: the shapes of `records.rs` and of the tables of /v1.
 *
 * Times are milliseconds since 1970-01-01 UTC by the coordinator's clock.
 */

import type { TileRun } from './runs.ts';

export type JobState = 'queued' | 'preparing' | 'baking' | 'paused' | 'assembling' | 'done' | 'failed' | 'cancelled';
export type Phase = 'probe' | 'bake';

/** All states, in the order of a job's life. */
export const JOB_STATES: readonly JobState[] = ['queued', 'preparing', 'baking', 'paused', 'assembling', 'done', 'failed', 'cancelled'];

export interface Problem {
  message: string;
  file?: string;
  line?: number;
}

export interface Progress {
  /** Tiles of the present phase, and those of them that are done. */
  tiles: number;
  tiles_done: number;
  texels: number;
  /** Of the present phase's cost, in [0, 1]. */
  fraction: number;
  rays: number;
  rays_per_second: number;
  workers: number;
  eta_seconds: number | null;
}

export interface JobRecord {
  id: string;
  scene: string | null;
  state: JobState;
  phase: Phase | null;
  settings: Record<string, unknown>;
  priority: number;
  labels: Record<string, string>;
  progress: Progress;
  problem: Problem | null;
  waiting: string | null;
  created_ms: number;
  started_ms: number | null;
  finished_ms: number | null;
}

export interface JobPage {
  jobs: JobRecord[];
  /** Cursor of the page behind this one; null where there is none. */
  next: string | null;
}

export interface WorkerRecord {
  id: string;
  name: string;
  threads: number;
  features: string[];
  since_ms: number;
  seen_ms: number;
  job: string | null;
  texels_done: number;
  rays: number;
  core_seconds: number;
  peak_rss_bytes: number;
  /** Over the last half minute; a coordinator that does not measure it leaves it out. */
  rays_per_second?: number;
  texels_per_second?: number;
}

/** Work of the last hour in buckets of `interval_ms`; buckets without work may be left out. */
export interface Throughput {
  interval_ms: number;
  points: { at_ms: number; rays: number; texels: number; tiles: number; workers: number }[];
}

/** One entry of a job's event stream. */
export type JobEvent = { seq: number; at_ms: number } & (
  | { event: 'state'; state: JobState; phase: Phase | null }
  | { event: 'tiles'; phase: Phase; runs: TileRun[]; tiles_done: number; tiles: number }
  | { event: 'problem'; problem: Problem }
);

/** The job as it is, sent in place of events that are no longer kept. */
export interface Snapshot {
  job: JobRecord;
  phase: Phase | null;
  runs: TileRun[];
}

/** Tiles that are done, of the present phase or of the last. */
export interface DoneTiles {
  phase: Phase | null;
  runs: TileRun[];
}

/** Whether nothing will change any more. */
export const isFinal = (state: JobState): boolean => state === 'done' || state === 'failed' || state === 'cancelled';

/** `file:line: message`, as the coordinator prints it. */
export function problemText({ file, line, message }: Problem): string {
  if (file === undefined) return message;
  return line === undefined ? `${file}: ${message}` : `${file}:${line}: ${message}`;
}
