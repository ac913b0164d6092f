/**
 * Geometry of the hemisphere plot: a direction grid as rings and sectors of the unit disc, seen from above the surface. theta 0 is the
 * centre, 90 degrees the rim; phi runs counter-clockwise from the right, as the texel's tangent points. Equal steps of theta are equally
 * wide rings: an equal-area map would squeeze the grazing rings, which are where light fields vary most.
 *
 * Points are (x, y) with y upward; callers with y downward turn it over. Angles are degrees.
 */

export interface Grid {
  nTheta: number;
  nPhi: number;
}

/** One sample direction of the grid. */
export interface Sector {
  i: number;
  j: number;
}

/** Where on the disc a direction lies. Below the horizon it stays on the rim. */
export function toDisc(theta: number, phi: number): [number, number] {
  const r = Math.min(Math.max(theta, 0), 90) / 90;
  const a = (phi * Math.PI) / 180;
  return [r * Math.cos(a), r * Math.sin(a)];
}

/** The sector around a point of the disc; null outside. Sector j is centred on phi_j, so the first one reaches to both sides of phi 0. */
export function sectorAt(x: number, y: number, { nTheta, nPhi }: Grid): Sector | null {
  const r = Math.hypot(x, y);
  if (r >= 1) return null;
  const phi = (Math.atan2(y, x) / (2 * Math.PI)) * nPhi;
  return { i: Math.floor(r * nTheta), j: wrap(Math.round(phi), nPhi) };
}

/** Bounds of a sector: radii in [0, 1] and angles in radians, counter-clockwise. */
export function sectorBounds({ i, j }: Sector, { nTheta, nPhi }: Grid): { inner: number; outer: number; from: number; to: number } {
  const step = (2 * Math.PI) / nPhi;
  return { inner: i / nTheta, outer: (i + 1) / nTheta, from: (j - 0.5) * step, to: (j + 0.5) * step };
}

/** Direction of a sector's sample, degrees. */
export function sectorDirection({ i, j }: Sector, { nTheta, nPhi }: Grid): { theta: number; phi: number } {
  return { theta: ((i + 0.5) * 90) / nTheta, phi: (j * 360) / nPhi };
}

/** Index of a sector's sample in depth order. */
export const sectorIndex = ({ i, j }: Sector, { nPhi }: Grid): number => i * nPhi + j;

/** The neighbour that an arrow key leads to: up and down change the ring (down is toward the centre), left and right go around. */
export function neighbour({ i, j }: Sector, key: string, { nTheta, nPhi }: Grid): Sector | null {
  switch (key) {
    case 'ArrowUp':
      return { i: Math.min(i + 1, nTheta - 1), j };
    case 'ArrowDown':
      return { i: Math.max(i - 1, 0), j };
    case 'ArrowLeft':
      return { i, j: wrap(j + 1, nPhi) };
    case 'ArrowRight':
      return { i, j: wrap(j - 1, nPhi) };
    default:
      return null;
  }
}

const wrap = (n: number, period: number): number => ((n % period) + period) % period;
