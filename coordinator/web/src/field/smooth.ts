/**
 * Normals and tangents at the corners of a smooth surface: the Rust crate's `proto::frame::surface` in TypeScript, in the same order of
 * operations.
 *
 * The normal is the author's, or the triangle's own where the author's does not point to the front. The tangent is the sum of dP/du over
 * the triangles that meet in this vertex of the texture (same chart, position and texture coordinates), each counted by its area.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { SurfacePlan } from '../format/plan.ts';
import type { SceneSurface } from '../format/scene.ts';
import { cross, dot, length, orientedFrame, scale, sub, vec3At } from './frame.ts';

/** What is interpolated over a surface: three vertices a triangle. */
export interface CornerFrames {
  positions: Float32Array;
  normals: Float32Array;
  tangents: Float32Array;
}

/**
 * Writes normals and tangents of a smooth surface whose positions are there; flat ones are, too, and are what a triangle's own normal is
 * taken from. With the rule `thesis` there is no tangent: the rotation is that of the interpolated normal.
 */
export function smoothCorners(out: CornerFrames, surface: SceneSurface, pool: Float32Array, plan: SurfacePlan, rule: 'texture' | 'thesis'): void {
  const vertices = vertexNumbers(surface.corners, plan);
  const sums = rule === 'texture' ? tangentSums(out.positions, plan.uv, vertices) : null;
  for (let v = 0; v < vertices.length; v++) {
    const own = vec3At(out.normals, v);
    if (length(own) === 0) continue;
    const authored = vec3At(pool, surface.normals[v]);
    const size = length(authored);
    const normal = size > 0 && dot(authored, own) > 0 ? scale(authored, 1 / size) : own;
    out.normals.set(normal, v * 3);
    out.tangents.set(sums ? orientedFrame(normal, unit(vec3At(sums, vertices[v]))).tangent : [0, 0, 0], v * 3);
  }
}

const unit = (v: Vec3): Vec3 => {
  const size = length(v);
  return size > 0 ? scale(v, 1 / size) : v;
};

function tangentSums(positions: Float32Array, uv: Float32Array, vertices: Uint32Array): Float64Array {
  const sums = new Float64Array(vertices.length * 3);
  for (let t = 0; t * 3 < vertices.length; t++) {
    const along = alongU(positions, uv, t);
    if (!along) continue;
    for (let c = 0; c < 3; c++) for (let axis = 0; axis < 3; axis++) sums[vertices[t * 3 + c] * 3 + axis] += along[axis];
  }
  return sums;
}

/** dP/du of a triangle, as long as twice its area; null where its texture coordinates or itself have none. */
function alongU(positions: Float32Array, uv: Float32Array, t: number): Vec3 | null {
  const [a, b, c] = [0, 1, 2].map((k) => vec3At(positions, t * 3 + k));
  const [e1, e2] = [sub(b, a), sub(c, a)];
  const [ua, va, ub, vb, uc, vc] = uv.subarray(t * 6, t * 6 + 6);
  const [dv1, dv2] = [vb - va, vc - va];
  const det = (ub - ua) * dv2 - (uc - ua) * dv1;
  const along = scale(sub(scale(e1, dv2), scale(e2, dv1)), Math.sign(det));
  const [size, area] = [length(along), length(cross(e1, e2))];
  const usable = det !== 0 && size > 1e-12 * (length(e1) + length(e2)) * (Math.abs(dv1) + Math.abs(dv2)) && area > 0;
  return usable ? scale(along, area / size) : null;
}

/**
 * The number of each corner's vertex of the texture. An open-addressed table over typed arrays: a Map with a text for each of millions of
 * corners takes seconds and gigabytes.
 */
export function vertexNumbers(corners: Uint32Array, { chart, uv }: Pick<SurfacePlan, 'chart' | 'uv'>): Uint32Array {
  const bits = new Uint32Array(uv.buffer, uv.byteOffset, uv.length);
  const slots = 2 ** Math.ceil(Math.log2(Math.max(2, corners.length * 2)));
  // The first corner of each vertex, from 1; 0 where a slot is free.
  const first = new Uint32Array(slots);
  const out = new Uint32Array(corners.length);
  const same = (a: number, b: number) =>
    corners[a] === corners[b] && bits[a * 2] === bits[b * 2] && bits[a * 2 + 1] === bits[b * 2 + 1] && chart[Math.floor(a / 3)] === chart[Math.floor(b / 3)];
  for (let v = 0; v < corners.length; v++) {
    let hash = corners[v];
    for (const word of [bits[v * 2], bits[v * 2 + 1], chart[Math.floor(v / 3)]]) hash = Math.imul(hash ^ word, 0x9e3779b1) ^ (hash >>> 15);
    let slot = (hash ^ (hash >>> 13)) & (slots - 1);
    while (first[slot] !== 0 && !same(first[slot] - 1, v)) slot = (slot + 1) & (slots - 1);
    if (first[slot] === 0) first[slot] = v + 1;
    out[v] = first[slot] - 1;
  }
  return out;
}
