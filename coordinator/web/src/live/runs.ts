/**
 * Sets of tiles as sorted, disjoint, non-adjacent runs: the Rust crate's `TileRuns` as far as a page needs it. A job of a million tiles is
 * a handful of these; a Set of numbers would cost the page its memory for nothing.
 */

/** The tiles `start` to before `end`. */
export interface TileRun {
  start: number;
  end: number;
}

export type TileRuns = readonly TileRun[];

/** Tiles in either set; `more` may be in any order. */
export function union(runs: TileRuns, more: TileRuns): TileRun[] {
  const sorted = [...runs, ...more].filter((r) => r.start < r.end).sort((a, b) => a.start - b.start);
  const merged: TileRun[] = [];
  for (const { start, end } of sorted) {
    const last = merged[merged.length - 1];
    if (last && start <= last.end) last.end = Math.max(last.end, end);
    else merged.push({ start, end });
  }
  return merged;
}

/** Tiles of `runs` that are not in `taken`. */
export function minus(runs: TileRuns, taken: TileRuns): TileRun[] {
  const left: TileRun[] = [];
  let t = 0;
  for (const { start, end } of runs) {
    let from = start;
    while (t < taken.length && taken[t].end <= from) t++;
    for (let i = t; i < taken.length && taken[i].start < end; i++) {
      if (from < taken[i].start) left.push({ start: from, end: taken[i].start });
      from = Math.max(from, taken[i].end);
    }
    if (from < end) left.push({ start: from, end });
  }
  return left;
}

/** Number of tiles. */
export const count = (runs: TileRuns): number => runs.reduce((sum, r) => sum + r.end - r.start, 0);

/** Number of tiles among `first` to before `first + length`. */
export function countWithin(runs: TileRuns, first: number, length: number): number {
  return runs.reduce((sum, r) => sum + Math.max(0, Math.min(r.end, first + length) - Math.max(r.start, first)), 0);
}

/** The first `tiles` tiles, in at most `pieces` runs. */
export function take(runs: TileRuns, tiles: number, pieces: number): TileRun[] {
  const taken: TileRun[] = [];
  for (const { start, end } of runs) {
    if (tiles <= 0 || taken.length >= pieces) break;
    taken.push({ start, end: Math.min(end, start + tiles) });
    tiles -= end - start;
  }
  return taken;
}

/** The set of some tile numbers. */
export const fromTiles = (tiles: readonly number[]): TileRun[] => union([], tiles.map((start) => ({ start, end: start + 1 })));

/** `0-9,12`, as queries of the coordinator name tiles. */
export const formatRuns = (runs: TileRuns): string =>
  runs.map(({ start, end }) => (end === start + 1 ? `${start}` : `${start}-${end - 1}`)).join(',');
