/**
 * Where to look from when nobody has said: the same rule as `kiln render`, so that page and picture agree.
 *
 * The eye stands off the centre of the bounds, in one of sixteen directions, where the fronts of most area face it (a room is looked into
 * through its open side); far enough that the bounding sphere fits. What hides what is not asked: it would take rays, and the winner is
 * seldom another.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import { cross, dot, length, scale, sub } from './frame.ts';
import { trianglePositions } from './geometry.ts';

export interface Camera {
  eye: Vec3;
  target: Vec3;
  /** Vertical, degrees. */
  fieldOfView: number;
}

export const DEFAULT_FIELD_OF_VIEW = 45;

/** The box around all positions that triangles use. */
export function sceneBounds({ scene }: Container): { low: Vec3; high: Vec3 } {
  const low: Vec3 = [Infinity, Infinity, Infinity];
  const high: Vec3 = [-Infinity, -Infinity, -Infinity];
  for (const surface of scene.surfaces) {
    for (const c of surface.corners) {
      for (let a = 0; a < 3; a++) {
        low[a] = Math.min(low[a], scene.positions[c * 3 + a]);
        high[a] = Math.max(high[a], scene.positions[c * 3 + a]);
      }
    }
  }
  return low[0] <= high[0] ? { low, high } : { low: [0, 0, 0], high: [0, 0, 0] };
}

/** The camera that a scene is first looked at with, in a view of width / height = `aspect`. */
export function defaultCamera(container: Container, aspect: number, fieldOfView = DEFAULT_FIELD_OF_VIEW): Camera {
  const { low, high } = sceneBounds(container);
  const target: Vec3 = scale([low[0] + high[0], low[1] + high[1], low[2] + high[2]], 0.5);
  const radius = length(sub(high, low)) / 2 || 1;
  const directions = [20, 40].flatMap((elevation) => Array.from({ length: 8 }, (_, k) => direction(k * 45, elevation)));
  const scores = directions.map(() => 0);
  for (const surface of container.scene.surfaces) {
    for (let t = 0; t < surface.corners.length / 3; t++) {
      const [a, b, c] = trianglePositions(container.scene.positions, surface.corners, t);
      const area = scale(cross(sub(b, a), sub(c, a)), 0.5);
      directions.forEach((d, i) => (scores[i] += Math.max(0, dot(area, d))));
    }
  }
  const best = directions[scores.indexOf(Math.max(...scores))];
  const half = (fieldOfView * Math.PI) / 360;
  const smaller = Math.min(half, Math.atan(Math.tan(half) * aspect));
  const eye = scale(best, radius / Math.sin(smaller));
  return { eye: [target[0] + eye[0], target[1] + eye[1], target[2] + eye[2]], target, fieldOfView };
}

function direction(azimuth: number, elevation: number): Vec3 {
  const [a, e] = [(azimuth * Math.PI) / 180, (elevation * Math.PI) / 180];
  return [Math.cos(e) * Math.sin(a), Math.sin(e), Math.cos(e) * Math.cos(a)];
}
