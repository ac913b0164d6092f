/**
 * A light field in memory: what was baked, where it lies, and a source of kept samples for each surface. A package and a job that is being
 * baked differ in their sources alone.
 */

import type { CodedSurface, KeptSamples } from '../format/coded.ts';
import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import type { SurfacePlan, Walk } from '../format/plan.ts';
import type { Manifest } from '../format/manifest.ts';
import { TILE_SIDE, type TileSegment } from '../format/segment.ts';
import { sceneBounds } from './camera.ts';
import { type SurfaceCover, surfaceCover } from './cover.ts';
import { type Block, sliceKept } from './decode.ts';
import { type SurfaceGeometry, sceneGeometry } from './geometry.ts';
import { type Grid, directionCount, parseGrid } from './grid.ts';

/** Where the kept samples of a surface come from. */
export interface SampleSource {
  /** The samples of a texel: `row` of `kept`; null where it holds none. */
  texel(x: number, y: number): { kept: KeptSamples; row: number } | null;
  /** All of them, in rectangles of at most `bytes` once expanded. */
  blocks(bytes: number): Iterable<Block>;
}

/** The files of a finished surface. */
export class PackageSource implements SampleSource {
  readonly coded: CodedSurface;
  private readonly directions: number;

  constructor(coded: CodedSurface, directions: number) {
    this.coded = coded;
    this.directions = directions;
  }

  texel(x: number, y: number): { kept: KeptSamples; row: number } | null {
    const row = y * this.coded.width + x;
    return this.coded.starts[row] < this.coded.starts[row + 1] ? { kept: this.coded, row } : null;
  }

  *blocks(bytes: number): Iterable<Block> {
    const { width, height } = this.coded;
    const rows = Math.max(1, Math.floor(bytes / (width * this.directions * 4)));
    for (let y = 0; y < height; y += rows) {
      const count = Math.min(rows, height - y);
      yield { x: 0, y, width, height: count, rowOf: null, kept: sliceKept(this.coded, y * width, (y + count) * width) };
    }
  }
}

/** Bytes of kept samples that live fields keep in memory, all surfaces together. */
export const LIVE_BYTES = 256 << 20;

/**
 * The tiles of a surface that have arrived so far. They are kept for picks and lost contexts while there is room; beyond it they are drawn
 * and forgotten: a job may be larger than the memory of a tab, and its package comes in the end.
 */
export class TileSource implements SampleSource {
  private readonly tiles = new Map<string, TileSegment>();
  private readonly plan: SurfacePlan;
  private readonly room: { bytes: number };

  /** `room` is shared by the surfaces of a field. */
  constructor(plan: SurfacePlan, room: { bytes: number }) {
    this.plan = plan;
    this.room = room;
  }

  add(tile: TileSegment): Block {
    const bytes = tile.kept.steps.byteLength + tile.kept.rgb.byteLength;
    if (bytes <= this.room.bytes) {
      this.room.bytes -= bytes;
      this.tiles.set(`${tile.cellX},${tile.cellY}`, tile);
    }
    return this.block(tile);
  }

  texel(x: number, y: number): { kept: KeptSamples; row: number } | null {
    const tile = this.tiles.get(`${Math.floor(x / TILE_SIDE)},${Math.floor(y / TILE_SIDE)}`);
    const row = tile ? tile.rowOf[(y % TILE_SIDE) * TILE_SIDE + (x % TILE_SIDE)] : -1;
    return tile && row >= 0 ? { kept: tile.kept, row } : null;
  }

  *blocks(): Iterable<Block> {
    for (const tile of this.tiles.values()) yield this.block(tile);
  }

  /** Tiles at the edge of the texture are cut to it. */
  private block(tile: TileSegment): Block {
    const [x, y] = [tile.cellX * TILE_SIDE, tile.cellY * TILE_SIDE];
    const [width, height] = [Math.min(TILE_SIDE, this.plan.width - x), Math.min(TILE_SIDE, this.plan.height - y)];
    const rowOf = new Int16Array(width * height);
    for (let j = 0; j < height; j++) rowOf.set(tile.rowOf.subarray(j * TILE_SIDE, j * TILE_SIDE + width), j * width);
    return { x, y, width, height, rowOf, kept: tile.kept };
  }
}

/** Everything about one surface. */
export interface FieldSurface {
  index: number;
  name: string;
  fileStem: string;
  plan: SurfacePlan;
  walk: Walk;
  source: SampleSource;
  geometry: SurfaceGeometry;
  /** null where it covers all that lies behind it. */
  cover: SurfaceCover | null;
  /** Number of its first tile in the Bake phase. */
  firstTile: number;
}

export interface LightField {
  container: Container;
  /** null while the job bakes. */
  manifest: Manifest | null;
  grid: Grid;
  /** Stops; 0 while they are not known. */
  exposureStops: number;
  surfaces: FieldSurface[];
  /** The box around everything, metres. */
  bounds: { low: Vec3; high: Vec3 };
  /** Raw samples of a surface as the bytes of its .mtex, for whoever asks; null where the package kept none. */
  loadRaw: ((surface: number) => Promise<Uint8Array>) | null;
}

/** Joins a container with sources. */
export function makeField(
  container: Container,
  manifest: Manifest | null,
  source: (surface: number, grid: Grid) => SampleSource,
  loadRaw: LightField['loadRaw'],
): LightField {
  const grid = parseGrid(container.plan.settings.directions);
  const geometries = sceneGeometry(container);
  let firstTile = 0;
  const surfaces = container.scene.surfaces.map((surface, index): FieldSurface => {
    const plan = container.plan.surfaces[index];
    const first = firstTile;
    firstTile += plan.tiles.length;
    return {
      index,
      name: surface.name,
      fileStem: surface.fileStem,
      plan,
      walk: container.plan.results?.walks[index] ?? 'phi',
      source: source(index, grid),
      geometry: geometries[index],
      cover: surfaceCover(container, index, geometries[index]),
      firstTile: first,
    };
  });
  const exposureStops = container.plan.results?.exposureStops ?? 0;
  return { container, manifest, grid, exposureStops, surfaces, bounds: sceneBounds(container), loadRaw };
}

/** A job that is being baked: no tile has arrived yet. */
export function makeLiveField(container: Container, bytes = LIVE_BYTES): LightField {
  const room = { bytes };
  return makeField(container, null, (surface) => new TileSource(container.plan.surfaces[surface], room), null);
}

/** D of a field. */
export const fieldDirections = (field: LightField): number => directionCount(field.grid);
