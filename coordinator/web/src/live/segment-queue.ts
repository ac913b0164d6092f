/**
 * Which finished tiles to ask for next: those that are done, not shown, and not already asked for. Pure; the feed does the asking.
 *
 * A request takes all that is wanted up to a limit, so that tiles which come while requests are under way are asked for together. A body
 * may hold fewer tiles than were asked for; the rest is wanted again.
 */

import { type TileRun, type TileRuns, fromTiles, minus, take, union } from './runs.ts';

/** Tiles of one request: some hundred kilobytes of segments. */
const TILES = 256;
/** Runs of one request: they travel in its URL. */
const PIECES = 64;

export class SegmentQueue {
  private shown: TileRuns = [];
  private asked: TileRuns = [];

  /** The next request for some of the tiles that are `done`; null where nothing is wanted. */
  next(done: TileRuns): TileRun[] | null {
    const wanted = take(minus(minus(done, this.shown), this.asked), TILES, PIECES);
    if (wanted.length === 0) return null;
    this.asked = union(this.asked, wanted);
    return wanted;
  }

  /** A request for `runs` has ended, with these tiles in its body. */
  settle(runs: TileRuns, got: readonly number[]): void {
    this.asked = minus(this.asked, runs);
    this.shown = union(this.shown, fromTiles(got));
  }
}
