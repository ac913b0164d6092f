/**
 * Brings a job into a viewer: its scene as soon as it has a plan, again when the Probe phase has found the exposure, its tiles as they are
 * done, and the package in their place when all is assembled.
 *
 * Errors of one request cost a pause, never the feed: the tiles stay wanted. What the coordinator says of the job as a whole is the
 * follower's affair.
 */

import type { ErrorDetail, KilnViewerElement } from '../viewer/api.ts';
import { askBytes, serviceUrl } from './http.ts';
import { type JobRecord, type Phase, isFinal } from './records.ts';
import { type TileRun, type TileRuns, formatRuns, fromTiles, minus, union } from './runs.ts';
import { SegmentQueue } from './segment-queue.ts';
import type { FollowState } from './state.ts';

/** Requests for segments under way at once. */
const AT_ONCE = 2;
/** Tiles that come within this time are asked for together. */
const COALESCE_MS = 100;
/** After a request that brought nothing. */
const PAUSE_MS = 2_000;

/** As whose scene the job's `scene.kiln` is worth having now: without exposure while it probes, with it from the Bake phase on. */
export function sceneWanted(job: JobRecord, have: Phase | null): Phase | null {
  if (job.state !== 'baking' && job.state !== 'paused' && job.state !== 'assembling') return null;
  const want = job.state !== 'assembling' && job.phase !== 'bake' ? 'probe' : 'bake';
  return want === have || have === 'bake' ? null : want;
}

export class LiveFeed {
  private readonly abort = new AbortController();
  private readonly queue = new SegmentQueue();
  private state: FollowState | null = null;
  private scene: Phase | null = null;
  private asking = 0;
  private fetchingScene = false;
  private pausedUntil = 0;
  private timer: number | undefined;
  private finished = false;
  /** Tiles that came, but could not be shown. */
  private damaged: TileRuns = [];
  /** The package could not be loaded, and the coordinator was away since. */
  private failed = false;
  private absent = false;

  /** `onFault` hears, as a sentence, of what the viewer could not show, and null when that is shown or no longer wanted. */
  constructor(
    private readonly job: string,
    private readonly viewer: KilnViewerElement,
    private readonly onFault: (sentence: string | null) => void,
  ) {}

  /** The job is in this state now. */
  update(state: FollowState): void {
    this.state = state;
    if (this.finished) return this.loadAgain(state);
    if (!state.job || state.gone) return;
    if (state.job.state === 'done') this.showPackage();
    else if (isFinal(state.job.state)) this.stop();
    else this.pump(COALESCE_MS);
  }

  /** The segments of a job that has ended are not kept. */
  private stop(): void {
    this.finished = true;
    this.abort.abort();
    clearTimeout(this.timer);
    this.onFault(null);
  }

  private showPackage(): void {
    this.stop();
    const { viewer } = this;
    if (viewer.model) {
      // A camera that was placed stays where it is; one that was not is placed anew for what is loaded.
      const { eye, target, fieldOfView } = viewer.getCamera();
      viewer.setCamera(eye, target, fieldOfView);
    }
    viewer.addEventListener('error', (event) => {
      this.failed ||= (event as Event as CustomEvent<ErrorDetail>).detail?.type === 'loadfailure';
    });
    viewer.src = serviceUrl(this.path('assets/manifest.json'));
  }

  /** A package that an absence cut off is loaded again after it; one that is damaged would only fail again. */
  private loadAgain({ awaySince, gone }: FollowState): void {
    if (!this.failed || gone) return;
    if (awaySince !== null) {
      this.absent = true;
    } else if (this.absent) {
      this.failed = this.absent = false;
      const { src } = this.viewer;
      this.viewer.src = '';
      this.viewer.src = src;
    }
  }

  /** Does what is to be done `delay` milliseconds from now, or later where a pause is on. */
  private pump(delay: number): void {
    if (this.timer !== undefined || this.finished) return;
    const wait = Math.max(delay, this.pausedUntil - performance.now());
    this.timer = window.setTimeout(() => {
      this.timer = undefined;
      this.turn();
    }, wait);
  }

  private turn(): void {
    const { state } = this;
    if (!state?.job || state.awaySince !== null || state.gone || this.finished) return;
    const want = sceneWanted(state.job, this.scene);
    if (want && !this.fetchingScene) void this.fetchScene(want);
    // Tiles of the Bake phase are coded under its exposure: they mean nothing to a scene that does not know it.
    while (this.scene === 'bake' && this.asking < AT_ONCE) {
      const runs = this.queue.next(state.baked);
      if (!runs) break;
      void this.fetchSegments(runs);
    }
  }

  private async fetchScene(phase: Phase): Promise<void> {
    this.fetchingScene = true;
    const answer = await askBytes(this.path('scene.kiln'), this.abort.signal);
    const shown = answer.kind === 'ok' && !this.finished && (await this.showScene(answer.value));
    this.fetchingScene = false;
    if (this.finished) return;
    if (shown) {
      this.scene = phase;
      this.onFault(null);
    } else {
      this.pause();
    }
    this.pump(0);
  }

  /** Resolves when the scene is drawn: tiles that came earlier would be added to the one that it replaces. */
  private showScene(bytes: ArrayBuffer): Promise<boolean> {
    return new Promise((resolve) => {
      const settled = new AbortController();
      const settle = (shown: boolean) => {
        settled.abort();
        resolve(shown);
      };
      this.viewer.addEventListener('load', () => settle(true), settled);
      this.viewer.addEventListener('error', () => settle(false), settled);
      if (!this.show(() => this.viewer.showLive(bytes))) settle(false);
    });
  }

  private async fetchSegments(runs: TileRun[]): Promise<void> {
    this.asking++;
    const answer = await askBytes(`${this.path('segments')}?runs=${formatRuns(runs)}`, this.abort.signal);
    this.asking--;
    if (this.finished) return;
    let tiles: number[] = [];
    if (answer.kind === 'ok' && !this.show(() => (tiles = this.viewer.addSegments(answer.value)))) this.damaged = union(this.damaged, runs);
    this.queue.settle(runs, tiles);
    this.mended(fromTiles(tiles));
    if (tiles.length === 0) this.pause();
    this.pump(0);
  }

  /** These are shown now; the last of those that could not be ends the complaint. */
  private mended(tiles: TileRuns): void {
    const left = minus(this.damaged, tiles);
    if (left.length === 0) this.onFault(null);
    this.damaged = left;
  }

  private pause(): void {
    this.pausedUntil = performance.now() + PAUSE_MS;
  }

  /** Bytes may be damaged on their way; that is worth a sentence, not the end of the page. */
  private show(work: () => void): boolean {
    try {
      work();
      return true;
    } catch (error) {
      this.onFault(`A part of the job could not be shown: ${(error as Error).message}. It is asked for again.`);
      return false;
    }
  }

  private path(what: string): string {
    return `v1/jobs/${encodeURIComponent(this.job)}/${what}`;
  }
}
