/**
 * `scene.kiln`: the canonical scene and the plan (docs/formats.md). Geometry, materials and layout of a package, and of a job from the
 * moment it is laid out. Textures are skipped: their colours are in the baked light already.
 */

import { ByteReader, FormatError } from './bytes.ts';
import { crc32c } from './crc32c.ts';

export type Vec3 = [number, number, number];
export type Walk = 'phi' | 'theta';

export interface Material {
  name: string;
  diffuse: Vec3;
  diffuseTexture: number | null;
  specular: Vec3;
  /** null: a perfect mirror. */
  exponent: number | null;
  /** Radiance, W/(sr m²). */
  emission: Vec3;
}

export interface SceneSurface {
  name: string;
  fileStem: string;
  material: number;
  /** Three vertex indices per triangle. */
  corners: Uint32Array;
}

export interface Scene {
  /** x, y, z in metres. */
  positions: Float32Array;
  surfaces: SceneSurface[];
  materials: Material[];
}

export interface PlannedTile {
  cellX: number;
  cellY: number;
  covered: number;
  gutter: number;
}

export interface SurfacePlan {
  width: number;
  height: number;
  charts: 'author' | 'polygons';
  /** Six per triangle: u, v of its corners. */
  uv: Float32Array;
  /** One per triangle. */
  chart: Uint32Array;
  covered: number;
  tiles: PlannedTile[];
}

export interface Plan {
  bakeVersion: number;
  settings: PlanSettings;
  surfaces: SurfacePlan[];
  /** Absent before the Probe phase has ended. */
  results: { exposureStops: number; walks: Walk[] } | null;
}

/** What the viewer needs of the settings; the rest is kept for display. */
export interface PlanSettings {
  directions: string;
  frame: 'texture' | 'thesis';
  raw: 'u8' | 'f32' | null;
  codec: string;
  [field: string]: unknown;
}

export interface Container {
  scene: Scene;
  plan: Plan;
}

const FILE = 'scene.kiln';
const HEADER = 32;

/** Reads a whole `scene.kiln`. Throws a {@link FormatError} where it is cut, damaged or of another version. */
export function parseContainer(bytes: Uint8Array): Container {
  const head = new ByteReader(bytes, FILE);
  const magic = head.take(4, 'header');
  if (String.fromCharCode(...magic) !== 'KLNS' || head.u16('version') !== 1) {
    throw head.error('it does not begin as a scene.kiln of version 1 does');
  }
  head.skip(2, 'header');
  const [sceneLength, planLength, crc] = [head.u64('scene length'), head.u64('plan length'), head.u32('checksum')];
  if (HEADER + sceneLength + planLength !== bytes.length) {
    throw head.error(`it has ${bytes.length} bytes; ${HEADER + sceneLength + planLength} expected`);
  }
  if (crc32c(bytes.subarray(HEADER)) !== crc) throw head.error('its checksum does not fit: it is damaged, load it again');
  const scene = readScene(new ByteReader(bytes.subarray(HEADER, HEADER + sceneLength), FILE));
  const plan = readPlan(new ByteReader(bytes.subarray(HEADER + sceneLength), FILE));
  check(scene, plan);
  return { scene, plan };
}

function check(scene: Scene, plan: Plan): void {
  const bad = (what: string) => new FormatError(`${FILE}: ${what}`);
  if (scene.surfaces.length !== plan.surfaces.length) throw bad('scene and plan have different numbers of surfaces');
  scene.surfaces.forEach((surface, i) => {
    const triangles = surface.corners.length / 3;
    const layout = plan.surfaces[i];
    if (layout.uv.length !== triangles * 6 || layout.chart.length !== triangles) throw bad(`surface ${surface.name} has no layout`);
    if (surface.material >= scene.materials.length) throw bad(`surface ${surface.name} has no material`);
    if (surface.corners.some((c) => c * 3 >= scene.positions.length)) throw bad(`surface ${surface.name} has a corner without position`);
  });
  if (plan.results && plan.results.walks.length !== scene.surfaces.length) throw bad('the plan does not say every walk');
}

function readScene(r: ByteReader): Scene {
  version(r, 'scene', 1);
  const positions = r.floats(r.length(12, 'positions') * 3, 'positions');
  const surfaces = list(r, 4, 'surfaces', () => readSurface(r));
  const materials = list(r, 40, 'materials', () => readMaterial(r));
  list(r, 4, 'textures', () => {
    r.text('texture name');
    r.varint('texture width');
    r.varint('texture height');
    r.skip(r.length(1, 'texture'), 'texture');
  });
  end(r);
  return { positions, surfaces, materials };
}

function readSurface(r: ByteReader): SceneSurface {
  const [name, fileStem, material] = [r.text('surface name'), r.text('file stem'), r.varint('material')];
  const count = r.length(5, 'triangles');
  const corners = new Uint32Array(count * 3);
  for (let t = 0; t < count; t++) {
    for (let c = 0; c < 3; c++) corners[t * 3 + c] = r.varint('corner');
    r.option(() => r.skip(24, 'texture coordinates'), 'texture coordinates');
    r.varint('polygon');
  }
  return { name, fileStem, material, corners };
}

function readMaterial(r: ByteReader): Material {
  const colour = (field: string): Vec3 => [r.f32(field), r.f32(field), r.f32(field)];
  const name = r.text('material name');
  const diffuse = colour('diffuse');
  const diffuseTexture = r.option(() => r.varint('diffuse texture'), 'diffuse texture');
  const specular = colour('specular');
  const exponent = r.variant(2, 'lobe') === 0 ? r.f32('exponent') : null;
  const emission = colour('emission');
  r.option(() => r.varint('emission texture'), 'emission texture');
  return { name, diffuse, diffuseTexture, specular, exponent, emission };
}

function readPlan(r: ByteReader): Plan {
  version(r, 'plan', 1);
  const bakeVersion = r.varint('bake version');
  r.skip(32, 'scene hash');
  const settings = JSON.parse(r.text('settings')) as PlanSettings;
  const surfaces = list(r, 8, 'layouts', () => readLayout(r));
  const results = r.option(() => {
    const exposureStops = r.signed('exposure') / 8;
    const walks = list(r, 1, 'walks', (): Walk => (r.variant(2, 'walk') === 0 ? 'phi' : 'theta'));
    r.varint('clipped share');
    return { exposureStops, walks };
  }, 'results');
  end(r);
  return { bakeVersion, settings, surfaces, results };
}

function readLayout(r: ByteReader): SurfacePlan {
  const size = /^(\d+)x(\d+)$/.exec(r.text('texture size'));
  if (!size) throw r.error('a texture size is not WIDTHxHEIGHT');
  const charts = r.variant(2, 'chart source') === 0 ? 'author' : 'polygons';
  const uv = r.floats(r.length(24, 'texture coordinates') * 6, 'texture coordinates');
  const chart = Uint32Array.from(list(r, 1, 'charts', () => r.varint('chart')));
  const covered = r.varint('covered texels');
  const tiles = list(r, 4, 'tiles', () => ({
    cellX: r.varint('cell'),
    cellY: r.varint('cell'),
    covered: r.varint('covered texels'),
    gutter: r.varint('gutter texels'),
  }));
  return { width: Number(size[1]), height: Number(size[2]), charts, uv, chart, covered, tiles };
}

function list<T>(r: ByteReader, bytesEach: number, field: string, read: () => T): T[] {
  const count = r.length(bytesEach, field);
  const out: T[] = [];
  for (let i = 0; i < count; i++) out.push(read());
  return out;
}

function version(r: ByteReader, what: string, known: number): void {
  const found = r.varint('version');
  if (found !== known) throw r.error(`${what} version ${found}; this page reads version ${known}`);
}

function end(r: ByteReader): void {
  if (r.left !== 0) throw r.error(`${r.left} bytes follow its end`);
}
