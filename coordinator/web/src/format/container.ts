/**
 * `scene.kiln`: the canonical scene and the plan in one file (docs/formats.md). Geometry and layout of a package, and of a job from the
 * moment it is laid out.
 */

import { ByteReader, FormatError } from './bytes.ts';
import { crc32c } from './crc32c.ts';
import { type Plan, readPlan } from './plan.ts';
import { type Scene, readScene } from './scene.ts';

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
  });
  if (plan.results && plan.results.walks.length !== scene.surfaces.length) throw bad('the plan does not say every walk');
}
