/**
 * Geometry of a surface for the GPU: three vertices of its own for each triangle, since frames are flat and every triangle has its own
 * texture coordinates. It costs 52 bytes a vertex; sharing vertices would save memory that is nothing beside the light.
 */

import type { Container, Vec3 } from '../format/container.ts';
import { type Frame, frameOfTriangle } from './frame.ts';

export interface SurfaceGeometry {
  positions: Float32Array;
  normals: Float32Array;
  tangents: Float32Array;
  uvs: Float32Array;
  /** Chart of each vertex, counted over the whole scene from 1: what tells two charts apart in pictures. */
  charts: Float32Array;
  triangles: number;
  /** The frame of each triangle, for picks. */
  frames: (Frame | null)[];
}

/** The geometries of all surfaces. */
export function sceneGeometry({ scene, plan }: Container): SurfaceGeometry[] {
  let before = 0;
  return scene.surfaces.map((surface, s) => {
    const layout = plan.surfaces[s];
    const count = surface.corners.length;
    const out: SurfaceGeometry = {
      positions: new Float32Array(count * 3),
      normals: new Float32Array(count * 3),
      tangents: new Float32Array(count * 3),
      uvs: layout.uv,
      charts: new Float32Array(count),
      triangles: count / 3,
      frames: [],
    };
    for (let t = 0; t < out.triangles; t++) addTriangle(out, t, surface.corners, scene.positions, plan.settings.frame, before + layout.chart[t] + 1);
    before += 1 + layout.chart.reduce((max, c) => Math.max(max, c), 0);
    return out;
  });
}

function addTriangle(out: SurfaceGeometry, t: number, indices: Uint32Array, positions: Float32Array, rule: 'texture' | 'thesis', chart: number): void {
  const corners = trianglePositions(positions, indices, t);
  const uv = [0, 1, 2].map((c): [number, number] => [out.uvs[t * 6 + c * 2], out.uvs[t * 6 + c * 2 + 1]]);
  const frame = frameOfTriangle(corners, uv, rule);
  out.frames.push(frame);
  for (let c = 0; c < 3; c++) {
    const v = t * 3 + c;
    out.positions.set(corners[c], v * 3);
    if (frame) {
      out.normals.set(frame.normal, v * 3);
      out.tangents.set(frame.tangent, v * 3);
    }
    out.charts[v] = chart;
  }
}

/** The corners of a triangle, metres. */
export function trianglePositions(positions: Float32Array, corners: Uint32Array, t: number): [Vec3, Vec3, Vec3] {
  const at = (c: number): Vec3 => {
    const i = corners[t * 3 + c] * 3;
    return [positions[i], positions[i + 1], positions[i + 2]];
  };
  return [at(0), at(1), at(2)];
}
