/** Local frames: the Rust crate's `proto::frame` in TypeScript, in the same order of operations, all in f64. */

import type { Vec3 } from '../format/bytes.ts';

/** Length that an interpolated tangent must have left beside the normal; `LF_LEAST_TANGENT` in `lf_surface.frag`. */
const LEAST_TANGENT = 1e-4;

export interface Frame {
  tangent: Vec3;
  bitangent: Vec3;
  normal: Vec3;
}

export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const scale = (a: Vec3, k: number): Vec3 => [a[0] * k, a[1] * k, a[2] * k];
export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const length = (a: Vec3): number => Math.sqrt(dot(a, a));

/** The three numbers of element `i`. */
export const vec3At = (values: Float32Array | Float64Array, i: number): Vec3 => [values[i * 3], values[i * 3 + 1], values[i * 3 + 2]];

/** The frame of a triangle with `corners` in metres and texture coordinates `uv`; null for a triangle without area. */
export function frameOfTriangle(corners: [Vec3, Vec3, Vec3], uv: [number, number][], rule: 'texture' | 'thesis'): Frame | null {
  const [e1, e2] = [sub(corners[1], corners[0]), sub(corners[2], corners[0])];
  const area = cross(e1, e2);
  const size = length(area);
  if (!(size > 0) || !Number.isFinite(size)) return null;
  const normal = scale(area, 1 / size);
  if (rule === 'thesis') return thesisFrame(normal);
  const [du1, dv1] = [uv[1][0] - uv[0][0], uv[1][1] - uv[0][1]];
  const [du2, dv2] = [uv[2][0] - uv[0][0], uv[2][1] - uv[0][1]];
  const det = du1 * dv2 - du2 * dv1;
  const along = scale(sub(scale(e1, dv2), scale(e2, dv1)), Math.sign(det));
  const tangent = sub(along, scale(normal, dot(normal, along)));
  const l = length(tangent);
  if (det === 0 || l <= 1e-12 * (length(e1) + length(e2)) * (Math.abs(dv1) + Math.abs(dv2))) return thesisFrame(normal);
  return fromAxes(scale(tangent, 1 / l), normal);
}

/** The frame of a unit normal whose x axis is `tangent` made orthogonal to it, or the thesis's where nothing is left of the tangent. */
export function orientedFrame(normal: Vec3, tangent: Vec3): Frame {
  const across = sub(tangent, scale(normal, dot(normal, tangent)));
  const size = length(across);
  return size >= LEAST_TANGENT ? fromAxes(scale(across, 1 / size), normal) : thesisFrame(normal);
}

/** The rotation about Y x N that carries +Y to `normal`; for N = -Y, 180 degrees about X (thesis 5.1.2). */
export function thesisFrame(normal: Vec3): Frame {
  const [x, y, z] = normal;
  const k = 1 / (1 + y);
  const image: Vec3 = y <= -1 + 1e-12 ? [1, 0, 0] : [1 - x * x * k, -x, -x * z * k];
  const tangent = sub(image, scale(normal, dot(normal, image)));
  return fromAxes(scale(tangent, 1 / length(tangent)), normal);
}

function fromAxes(tangent: Vec3, normal: Vec3): Frame {
  return { tangent, bitangent: cross(normal, tangent), normal };
}

/** A world direction in the frame. */
export function toLocal(frame: Frame, world: Vec3): Vec3 {
  return [dot(frame.tangent, world), dot(frame.bitangent, world), dot(frame.normal, world)];
}
