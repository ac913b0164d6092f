/** The plan within `scene.kiln` (docs/formats.md): how the surfaces of a scene are laid out in texture space and cut into tiles. */

import type { ByteReader } from './bytes.ts';

const PLAN_VERSION = 2;
const SOURCES = ['author', 'polygons', 'atlas', 'parts', 'front'] as const;
const WALKS = ['phi', 'theta'] as const;

export type Walk = (typeof WALKS)[number];

export interface PlannedTile {
  cellX: number;
  cellY: number;
  covered: number;
  gutter: number;
}

export interface SurfacePlan {
  width: number;
  height: number;
  /** Where the charts came from. */
  charts: (typeof SOURCES)[number];
  /** Six per triangle: u, v of its corners. */
  uv: Float32Array;
  /** One per triangle. */
  chart: Uint32Array;
  covered: number;
  tiles: PlannedTile[];
}

/** What the viewer needs of the settings; the rest is kept for display. */
export interface PlanSettings {
  directions: string;
  frame: 'texture' | 'thesis';
  raw: 'u8' | 'f32' | null;
  codec: string;
  [field: string]: unknown;
}

export interface Plan {
  bakeVersion: number;
  settings: PlanSettings;
  surfaces: SurfacePlan[];
  /** Absent before the Probe phase has ended. */
  results: { exposureStops: number; walks: Walk[] } | null;
}

export function readPlan(r: ByteReader): Plan {
  const version = r.varint('plan version');
  if (version !== PLAN_VERSION) throw r.error(`plan version ${version}; this page reads version ${PLAN_VERSION}`);
  const bakeVersion = r.varint('bake version');
  r.skip(32, 'scene hash');
  const settings = readSettings(r);
  const surfaces = r.list(8, 'layouts', () => readLayout(r));
  const results = r.option(() => {
    const exposureStops = r.signed('exposure') / 8;
    const walks = r.list(1, 'walks', () => r.variant(WALKS, 'walk'));
    r.varint('clipped share');
    return { exposureStops, walks };
  }, 'results');
  r.end();
  return { bakeVersion, settings, surfaces, results };
}

function readSettings(r: ByteReader): PlanSettings {
  const text = r.text('settings');
  try {
    return JSON.parse(text) as PlanSettings;
  } catch (error) {
    throw r.error(`its settings are not JSON (${(error as Error).message})`);
  }
}

function readLayout(r: ByteReader): SurfacePlan {
  const size = /^(\d+)x(\d+)$/.exec(r.text('texture size'));
  if (!size) throw r.error('a texture size is not WIDTHxHEIGHT');
  const charts = r.variant(SOURCES, 'chart source');
  const uv = r.floats(r.length(24, 'texture coordinates') * 6, 'texture coordinates');
  const chart = r.varints(1, 'charts');
  const covered = r.varint('covered texels');
  const tiles = r.list(4, 'tiles', () => ({
    cellX: r.varint('cell'),
    cellY: r.varint('cell'),
    covered: r.varint('covered texels'),
    gutter: r.varint('gutter texels'),
  }));
  return { width: Number(size[1]), height: Number(size[2]), charts, uv, chart, covered, tiles };
}
