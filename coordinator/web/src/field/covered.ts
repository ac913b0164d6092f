/**
 * Which texels are covered, as docs/formats.md says: those whose centre lies on a triangle, and those that the tip of a narrow chart
 * reaches into between all centres. Triangles without area, in the world or in the texture, do not count. Asked for one texel at a time, so
 * that nothing is kept for it: one pass over the triangles, most of which their boxes rule out. `proto::texel` is the same in Rust, in the
 * same order of operations.
 */

import type { SurfacePlan } from '../format/plan.ts';
import type { SurfaceGeometry } from './geometry.ts';

/** Texels around a texel among which a covered one makes it gutter. */
const GUTTER = 2;
/** What counts as nothing, in texels. */
const SLACK = 1e-3;
/** The same of the weights of corners. */
const EDGE = 1e-9;
/** Twice the area, in texels, below which a triangle has none in the texture. */
const LEAST_AREA = 1e-12;

type Point = [number, number];

/** A triangle in texels. */
interface Flat {
  corners: [Point, Point, Point];
  /** Twice its area, negative where it is turned over. */
  det: number;
}

/** The layout of a surface, and its normals: three vertices a triangle, zero where it has no area. */
export interface Covering {
  plan: Pick<SurfacePlan, 'width' | 'height' | 'uv'>;
  geometry: Pick<SurfaceGeometry, 'normals'>;
}

/** Whether a texel shows light of its own place: gutter texels have that of a neighbour. */
export function isCovered({ plan, geometry }: Covering, x: number, y: number): boolean {
  const [square, around] = [squareAround(plan, x, y), centresAround(plan, x, y)];
  let [isNear, isTip] = [false, false];
  for (let t = 0; t * 6 < plan.uv.length; t++) {
    if (!meets(plan.uv, t, square) || !hasArea(geometry.normals, t)) continue;
    const flat = flatOf(plan, t);
    if (Math.abs(flat.det) <= LEAST_AREA) continue;
    if (holds(flat, [x + 0.5, y + 0.5])) return true;
    isNear ||= around.some((centre) => holds(flat, centre));
    isTip ||= !isNear && reachesInto(flat.corners, x, y);
  }
  return isTip && !isNear;
}

/** The centres of the texels within a gutter's reach of a texel, but its own. */
function centresAround({ width, height }: Covering['plan'], x: number, y: number): Point[] {
  const out: Point[] = [];
  for (let row = Math.max(0, y - GUTTER); row <= Math.min(height - 1, y + GUTTER); row++) {
    for (let column = Math.max(0, x - GUTTER); column <= Math.min(width - 1, x + GUTTER); column++) {
      if (column !== x || row !== y) out.push([column + 0.5, row + 0.5]);
    }
  }
  return out;
}

/** The square of texels within a gutter's reach of a texel, in texture coordinates: low u, low v, high u, high v. */
function squareAround({ width, height }: Covering['plan'], x: number, y: number): [number, number, number, number] {
  const margin = GUTTER + SLACK;
  return [(x - margin) / width, (y - margin) / height, (x + 1 + margin) / width, (y + 1 + margin) / height];
}

/** Whether a triangle's box meets a square. Allocates nothing: it is asked of every triangle of a surface. */
function meets(uv: Float32Array, t: number, [lowU, lowV, highU, highV]: [number, number, number, number]): boolean {
  const i = t * 6;
  const isBefore = (uv[i] < lowU && uv[i + 2] < lowU && uv[i + 4] < lowU) || (uv[i + 1] < lowV && uv[i + 3] < lowV && uv[i + 5] < lowV);
  const isBeyond = (uv[i] > highU && uv[i + 2] > highU && uv[i + 4] > highU) || (uv[i + 1] > highV && uv[i + 3] > highV && uv[i + 5] > highV);
  return !isBefore && !isBeyond;
}

function hasArea(normals: Float32Array, t: number): boolean {
  return normals[t * 9] !== 0 || normals[t * 9 + 1] !== 0 || normals[t * 9 + 2] !== 0;
}

function flatOf({ uv, width, height }: Covering['plan'], t: number): Flat {
  const corner = (k: number): Point => [uv[t * 6 + k * 2] * width, uv[t * 6 + k * 2 + 1] * height];
  const [a, b, c] = [corner(0), corner(1), corner(2)];
  return { corners: [a, b, c], det: (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]) };
}

/** Whether a point lies on a triangle. Weights of slivers round worse than their boxes. */
function holds({ corners: [a, b, c], det }: Flat, at: Point): boolean {
  for (const axis of [0, 1]) {
    if (at[axis] < Math.min(a[axis], b[axis], c[axis]) - SLACK || at[axis] > Math.max(a[axis], b[axis], c[axis]) + SLACK) return false;
  }
  const [dx, dy] = [at[0] - a[0], at[1] - a[1]];
  const second = ((c[1] - a[1]) / det) * dx + (-(c[0] - a[0]) / det) * dy;
  const third = (-(b[1] - a[1]) / det) * dx + ((b[0] - a[0]) / det) * dy;
  return second >= -EDGE && third >= -EDGE && second + third <= 1 + EDGE;
}

/** Whether the mean of the corners of what a triangle has in a texel's square lies within it by more than nothing. */
function reachesInto(triangle: Point[], x: number, y: number): boolean {
  let polygon = triangle;
  for (const [axis, low] of [x, y].entries()) {
    polygon = clip(clip(polygon, (p) => p[axis] - low), (p) => low + 1 - p[axis]);
  }
  if (polygon.length === 0) return false;
  return [x, y].every((low, axis) => {
    const mean = polygon.reduce((sum, p) => sum + p[axis], 0) / polygon.length;
    return mean > low + SLACK && mean < low + 1 - SLACK;
  });
}

/** What of a convex polygon lies where `side` is not negative. */
function clip(polygon: Point[], side: (p: Point) => number): Point[] {
  return polygon.flatMap((p, k) => {
    const q = polygon[(k + 1) % polygon.length];
    const [atP, atQ] = [side(p), side(q)];
    const t = atP / (atP - atQ);
    const crossing: Point[] = atP < 0 === atQ < 0 ? [] : [[p[0] + (q[0] - p[0]) * t, p[1] + (q[1] - p[1]) * t]];
    return atP >= 0 ? [p, ...crossing] : crossing;
  });
}
