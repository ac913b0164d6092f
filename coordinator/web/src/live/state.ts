/**
 * What a page knows of the job that it follows, and how that changes: a pure reducer over what the coordinator says. The follower feeds it,
 * the page draws it.
 *
 * Two sources overlap. The record (asked for every two seconds) is the truth of state, progress and problem; the events add what it does
 * not hold, the tiles that are done, and bring changes sooner. Events are replayed from the beginning when a page opens, so they may only
 * carry a job forward; the record may do anything.
 */

import { type JobEvent, type JobRecord, type JobState, type Phase, type Snapshot, isFinal } from './records.ts';
import { type TileRuns, count, union } from './runs.ts';

export interface FollowState {
  /** Null until the coordinator has answered for the first time. */
  job: JobRecord | null;
  /** When it stopped answering, by this machine's clock; null while it answers. */
  awaySince: number | null;
  /** Why it does not tell how the job is, in its words; null while it does, or says nothing at all. */
  refused: string | null;
  /** The job is not there: never was (`unknown`), or was removed while it was followed (`deleted`). */
  gone: 'unknown' | 'deleted' | null;
  /** Sequence number of the last event. */
  seq: number;
  /** Tiles of the Bake phase that are done. */
  baked: TileRuns;
  /** Some events were missed; the state was restored from a snapshot. */
  missed: boolean;
}

export const INITIAL: FollowState = { job: null, awaySince: null, refused: null, gone: null, seq: 0, baked: [], missed: false };

/** What the coordinator said, or that it said nothing. */
export type Input =
  | { kind: 'record'; job: JobRecord }
  | { kind: 'event'; event: JobEvent }
  | { kind: 'snapshot'; seq: number; snapshot: Snapshot }
  | { kind: 'tiles'; phase: Phase | null; runs: TileRuns }
  | { kind: 'not-found' }
  | { kind: 'refused'; detail: string }
  | { kind: 'away'; at: number };

/** The state after `input`; the same object where nothing changes. */
export function apply(state: FollowState, input: Input): FollowState {
  switch (input.kind) {
    case 'record':
      return { ...state, job: input.job, awaySince: null, refused: null, gone: null };
    case 'tiles':
      return input.phase === 'bake' ? { ...state, baked: union(state.baked, input.runs) } : state;
    case 'not-found':
      return state.gone ? state : { ...state, awaySince: null, refused: null, gone: state.job ? 'deleted' : 'unknown' };
    case 'refused':
      return state.refused === input.detail ? state : { ...state, awaySince: null, refused: input.detail };
    case 'away':
      return state.awaySince === null ? { ...state, awaySince: input.at, refused: null } : state;
    case 'snapshot':
      return applySnapshot(state, input.seq, input.snapshot);
    case 'event':
      return input.event.seq <= state.seq ? state : applyEvent(state, input.event);
  }
}

/** A snapshot at the beginning is how a long history is told; later it means that events were missed. */
function applySnapshot(state: FollowState, seq: number, { job, phase, runs }: Snapshot): FollowState {
  const baked = phase === 'bake' ? union([], runs) : [];
  return { ...state, job, awaySince: null, refused: null, gone: null, seq, baked, missed: state.missed || state.seq > 0 };
}

function applyEvent(state: FollowState, event: JobEvent): FollowState {
  const next = { ...state, seq: event.seq, awaySince: null };
  if (event.event === 'tiles') {
    const baked = event.phase === 'bake' ? union(state.baked, event.runs) : state.baked;
    return { ...next, baked, job: state.job && withTiles(state.job, event.phase, event.tiles_done, event.tiles) };
  }
  if (event.event === 'state' && state.job && follows(event, state.job)) {
    return { ...next, job: { ...state.job, state: event.state, phase: event.phase } };
  }
  return next;
}

/** A count that runs ahead of the record's; the fraction stays the record's, which knows what each tile costs. */
function withTiles(job: JobRecord, phase: Phase, tilesDone: number, tiles: number): JobRecord {
  if (job.phase !== phase || tilesDone <= job.progress.tiles_done) return job;
  return { ...job, progress: { ...job.progress, tiles, tiles_done: tilesDone } };
}

/** Whether an event tells something newer than the record: further along its life, or paused and resumed at the same place. */
function follows(event: { state: JobState; phase: Phase | null }, job: JobRecord): boolean {
  const [then, now] = [rank(job.state, job.phase), rank(event.state, event.phase)];
  return now > then || (now === then && now < 4 && event.state !== job.state);
}

/** How far along its life a job is. */
function rank(state: JobState, phase: Phase | null): number {
  if (isFinal(state)) return 5;
  const baking = phase === 'bake' ? 3 : 2;
  return { queued: 0, preparing: 1, baking, paused: baking, assembling: 4 }[state as 'queued' | 'preparing' | 'baking' | 'paused' | 'assembling'];
}

/** Done tiles of the Bake phase, for a job whose events may not have been read: a finished one has them all. */
export const bakedTiles = (state: FollowState): number => (state.job?.state === 'done' ? state.job.progress.tiles : count(state.baked));
