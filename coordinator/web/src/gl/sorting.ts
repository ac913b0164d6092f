/**
 * The order in which blended triangles are drawn: back to front by their centroids, which is exact for triangles that do not cross and of
 * about the same size. Counted into 65,536 distances rather than compared: linear, so that a view can be turned with hundreds of thousands
 * of leaves in it.
 */

import type { Vec3 } from '../format/bytes.ts';

const DISTANCES = 1 << 16;

/** Writes the vertices of `triangles` (three a triangle, in their order in the geometry) into `index`, the farthest from `eye` first. */
export function sortBackToFront(triangles: Uint32Array, positions: Float32Array, eye: Vec3, index: Uint32Array): void {
  const distances = new Float64Array(triangles.length);
  let [least, most] = [Infinity, -Infinity];
  triangles.forEach((t, i) => {
    let square = 0;
    for (let axis = 0; axis < 3; axis++) {
      const at = t * 9 + axis;
      square += ((positions[at] + positions[at + 3] + positions[at + 6]) / 3 - eye[axis]) ** 2;
    }
    distances[i] = Math.sqrt(square);
    least = Math.min(least, distances[i]);
    most = Math.max(most, distances[i]);
  });
  const factor = most > least ? (DISTANCES - 1) / (most - least) : 0;
  const bucket = (i: number) => Math.floor((most - distances[i]) * factor);
  const ends = new Uint32Array(DISTANCES + 1);
  for (let i = 0; i < triangles.length; i++) ends[bucket(i) + 1]++;
  for (let b = 0; b < DISTANCES; b++) ends[b + 1] += ends[b];
  triangles.forEach((t, i) => {
    const at = ends[bucket(i)]++ * 3;
    for (let c = 0; c < 3; c++) index[at + c] = t * 3 + c;
  });
}
