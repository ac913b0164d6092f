/**
 * The `spherical` direction grid and the walks over it: the same definitions as the Rust crate's `proto::grid`, in the same words.
 * theta_i = (i + 1/2) * 90/nTheta degrees from the normal, phi_j = j * 360/nPhi degrees from the tangent, depth = i * nPhi + j.
 */

import { FormatError, type Vec3 } from '../format/bytes.ts';
import type { Walk } from '../format/plan.ts';

export interface Grid {
  nTheta: number;
  nPhi: number;
}

/** Reads `20x20`. */
export function parseGrid(text: string): Grid {
  const match = /^(\d+)x(\d+)$/.exec(text);
  const grid = match && { nTheta: Number(match[1]), nPhi: Number(match[2]) };
  if (!grid || grid.nTheta < 1 || grid.nPhi < 2 || grid.nTheta > 64 || grid.nPhi > 64 || grid.nPhi % 2 !== 0) {
    throw new FormatError(`directions ${text}: expected INCLINATIONSxAZIMUTHS up to 64x64, azimuths even`);
  }
  return grid;
}

/** D. */
export const directionCount = (grid: Grid): number => grid.nTheta * grid.nPhi;

/** Inclination and azimuth of a depth, radians. */
export function anglesOf(grid: Grid, depth: number): { theta: number; phi: number } {
  const i = Math.floor(depth / grid.nPhi);
  return { theta: ((i + 0.5) * Math.PI) / 2 / grid.nTheta, phi: ((depth % grid.nPhi) * 2 * Math.PI) / grid.nPhi };
}

/** The local unit direction of a depth: x along the tangent, y along the bitangent, z along the normal. */
export function directionOf(grid: Grid, depth: number): Vec3 {
  const { theta, phi } = anglesOf(grid, depth);
  return [Math.sin(theta) * Math.cos(phi), Math.sin(theta) * Math.sin(phi), Math.cos(theta)];
}

/** Which step of the walk visits each depth. */
export function stepOfDepth(grid: Grid, walk: Walk): Uint16Array {
  const steps = new Uint16Array(directionCount(grid));
  for (let depth = 0; depth < steps.length; depth++) {
    steps[depth] = walk === 'phi' ? depth : (depth % grid.nPhi) * grid.nTheta + Math.floor(depth / grid.nPhi);
  }
  return steps;
}

/** Which depth each step of the walk visits. */
export function depthOfStep(grid: Grid, walk: Walk): Uint16Array {
  const steps = stepOfDepth(grid, walk);
  const depths = new Uint16Array(steps.length);
  steps.forEach((step, depth) => (depths[step] = depth));
  return depths;
}

/** Weights of the directions in the cosine-weighted mean over the hemisphere (radiosity / pi): cos theta sin theta, summing to one. */
export function cosineWeights(grid: Grid): Float64Array {
  const weights = new Float64Array(directionCount(grid));
  let sum = 0;
  for (let depth = 0; depth < weights.length; depth++) {
    const { theta } = anglesOf(grid, depth);
    weights[depth] = Math.cos(theta) * Math.sin(theta);
    sum += weights[depth];
  }
  return weights.map((w) => w / sum);
}
