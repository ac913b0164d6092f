/**
 * The author's cameras as views of this viewer, which orbits an upright camera with a perspective around a target. A camera that is rolled
 * is set upright; an orthographic one becomes a lens from so far away that its view is all but parallel.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { SceneCamera } from '../format/light.ts';
import type { Camera } from '../field/camera.ts';
import { add, dot, length, scale, sub } from '../field/frame.ts';

/** The names that the cameras of a scene are chosen by: the author's, made distinct. */
export function cameraNames(cameras: SceneCamera[]): string[] {
  const taken = new Set<string>();
  return cameras.map(({ name }, i) => {
    const own = name || `Camera ${i + 1}`;
    let distinct = own;
    for (let n = 2; taken.has(distinct); n++) distinct = `${own} (${n})`;
    taken.add(distinct);
    return distinct;
  });
}

/** Degrees of the lens that stands for a parallel view. */
const PARALLEL = 4;
/** Fields of view that the viewer takes, degrees. */
const LEAST = 1;
const MOST = 170;

/** The view of a camera in a picture of width / height = `aspect`. Its target lies in its direction, beside the middle of the scene. */
export function viewOf(camera: SceneCamera, bounds: { low: Vec3; high: Vec3 }, aspect: number): Camera {
  const { eye, forward, lens } = camera;
  const centre = scale(add(bounds.low, bounds.high), 0.5);
  const radius = length(sub(bounds.high, bounds.low)) / 2 || 1;
  const ahead = dot(sub(centre, eye), forward);
  const distance = ahead > radius * 0.01 ? ahead : radius;
  const target = add(eye, scale(forward, distance));
  if (lens.kind === 'orthographic') {
    const away = lens.halfHeight / Math.tan((PARALLEL * Math.PI) / 360);
    return { eye: sub(target, scale(forward, away)), target, fieldOfView: PARALLEL };
  }
  const half = lens.fov / 2;
  const vertical = lens.ofSmaller && aspect < 1 ? Math.atan(Math.tan(half) / aspect) : half;
  return { eye, target, fieldOfView: Math.min(MOST, Math.max(LEAST, (vertical * 360) / Math.PI)) };
}
