/**
 * Which texels are covered, as docs/formats.md says: those whose centre lies on a triangle, and those that the tip of a narrow chart reaches
 * into between all centres. Asked for one texel at a time, so that nothing is kept for it.
 */

import type { SurfacePlan } from '../format/plan.ts';

/** Texels around a texel among which a covered one makes it gutter. */
const GUTTER = 2;
/** What counts as nothing, in texels. */
const SLACK = 1e-3;

type Point = [number, number];

/** Whether a texel shows light of its own place: gutter texels have that of a neighbour. */
export function isCovered(plan: SurfacePlan, x: number, y: number): boolean {
  if (isUnderCentre(plan, x, y)) return true;
  for (let dy = -GUTTER; dy <= GUTTER; dy++) {
    for (let dx = -GUTTER; dx <= GUTTER; dx++) {
      const [column, row] = [x + dx, y + dy];
      const isThere = column >= 0 && column < plan.width && row >= 0 && row < plan.height;
      if (isThere && isUnderCentre(plan, column, row)) return false;
    }
  }
  for (let i = 0; i < plan.uv.length; i += 6) {
    if (reachesInto(corners(plan, i), x, y)) return true;
  }
  return false;
}

function isUnderCentre(plan: SurfacePlan, x: number, y: number): boolean {
  const [u, v] = [(x + 0.5) / plan.width, (y + 0.5) / plan.height];
  for (let i = 0; i < plan.uv.length; i += 6) {
    const [ax, ay, bx, by, cx, cy] = plan.uv.subarray(i, i + 6);
    const det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (det === 0) continue;
    const b = ((u - ax) * (cy - ay) - (cx - ax) * (v - ay)) / det;
    const c = ((bx - ax) * (v - ay) - (u - ax) * (by - ay)) / det;
    if (b >= -1e-9 && c >= -1e-9 && b + c <= 1 + 1e-9) return true;
  }
  return false;
}

/** A triangle's corners in texels. */
function corners({ uv, width, height }: SurfacePlan, at: number): Point[] {
  return [0, 2, 4].map((k) => [uv[at + k] * width, uv[at + k + 1] * height]);
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
