/** What lies under a point of the view: the texel, and its hemisphere as decoded. */

import { type Intersection, type PerspectiveCamera, Raycaster, type Vector2, Vector3 } from 'three';
import type { Vec3 } from '../format/bytes.ts';
import { partOf } from '../format/scene.ts';
import { type Cover, opacityAt } from '../field/cover.ts';
import { isCovered } from '../field/covered.ts';
import type { FieldSurface, LightField } from '../field/light-field.ts';
import { EOTF, decodeRow } from '../field/decode.ts';
import { toLocal } from '../field/frame.ts';
import { frameAt } from '../field/geometry.ts';
import { depthOfStep, directionCount } from '../field/grid.ts';
import type { LightFieldObject } from '../gl/object.ts';
import type { TexelSample } from './api.ts';

/** Below it a surface is not picked but what lies behind it. */
const LEAST_OPACITY = 1 / 16;

/** The texel under a point in normalised device coordinates; null behind the scene and where no tile has arrived. */
export function pick(object: LightFieldObject, camera: PerspectiveCamera, at: Vector2): TexelSample | null {
  const ray = new Raycaster();
  ray.setFromCamera(at, camera);
  const found = ray.intersectObject(object, true).map((hit) => hitOf(object.field, hit)).find((hit) => hit !== null);
  if (!found) return null;
  const { hit, surface, triangle, weights } = found;
  const local = object.worldToLocal(hit.point.clone());
  const toEye = object.worldToLocal(camera.getWorldPosition(new Vector3())).sub(local).normalize();
  return sampleTexel(object.field, surface, { triangle, weights }, local.toArray(), toEye.toArray());
}

/** A point of a surface: a triangle, and the barycentric weights of its corners. */
export interface SurfacePoint {
  triangle: number;
  weights: Vec3;
}

/** Where a ray meets a surface; null where it goes through a hole of a mask, or through next to nothing. */
function hitOf(field: LightField, hit: Intersection): (SurfacePoint & { hit: Intersection; surface: FieldSurface }) | null {
  const { surface: index, cover } = hit.object.userData as { surface?: number; cover?: Cover | null };
  if (index === undefined || !hit.face || !hit.barycoord) return null;
  const surface = field.surfaces[index];
  const [triangle, weights] = [Math.floor(hit.face.a / 3), hit.barycoord.toArray()];
  if (cover && surface.cover && opacityAt(field.container.scene, surface.cover, cover, triangle, weights) < LEAST_OPACITY) return null;
  return { hit, surface, triangle, weights };
}

/** The texel of a surface at a point of it, seen from the unit direction `toEye`. */
export function sampleTexel(field: LightField, surface: FieldSurface, { triangle, weights }: SurfacePoint, position: Vec3, toEye: Vec3): TexelSample | null {
  const { width, height, uv } = surface.plan;
  const at = (axis: number) => weights.reduce((sum, w, c) => sum + w * uv[triangle * 6 + c * 2 + axis], 0);
  const x = Math.min(width - 1, Math.max(0, Math.floor(at(0) * width)));
  const y = Math.min(height - 1, Math.max(0, Math.floor(at(1) * height)));
  const found = surface.source.texel(x, y);
  const frame = frameAt(surface.geometry, triangle, weights);
  if (!found || !frame) return null;
  const count = directionCount(field.grid);
  const bySteps = new Uint8Array(count * 3);
  decodeRow(found.kept, found.row, bySteps);
  const coded = new Uint8Array(count * 3);
  depthOfStep(field.grid, surface.walk).forEach((depth, step) => coded.set(bySteps.subarray(step * 3, step * 3 + 3), depth * 3));
  const factor = 2 ** -field.exposureStops;
  const w = toLocal(frame, toEye);
  return {
    surface: surface.name,
    surfaceIndex: surface.index,
    part: partOf(field.container.scene.surfaces[surface.index], triangle)?.name ?? surface.name,
    x,
    y,
    position,
    grid: field.grid,
    coded,
    radiance: Float32Array.from(coded, (byte) => EOTF[byte] * factor),
    keptSamples: found.kept.starts[found.row + 1] - found.kept.starts[found.row],
    view: { theta: degrees(Math.atan2(Math.hypot(w[0], w[1]), w[2])), phi: (degrees(Math.atan2(w[1], w[0])) + 360) % 360 },
    covered: isCovered(surface, x, y),
  };
}

const degrees = (radians: number): number => (radians * 180) / Math.PI;
