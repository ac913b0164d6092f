/**
 * Geometry of a surface for the GPU: three vertices of its own for each triangle, since every triangle has its own texture coordinates and,
 * on flat surfaces, its own frame. It costs 56 bytes a vertex; sharing vertices would save memory that is nothing beside the light.
 *
 * The back of a two-sided surface is a surface with triangles of its own, turned over, and is culled as every surface is: what is seen of
 * the two is decided before a fragment is shaded. One mesh that chooses by `gl_FrontFacing` would save its vertices and bind the textures
 * of both sides.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import { type Frame, add, frameOfTriangle, length, orientedFrame, scale, vec3At } from './frame.ts';
import { type CornerFrames, smoothCorners } from './smooth.ts';

export interface SurfaceGeometry extends CornerFrames {
  uvs: Float32Array;
  /** Chart of each vertex, counted over the whole scene from 1: what tells two charts apart in pictures. */
  charts: Float32Array;
  /** Part of each vertex, counted over the whole scene from 0. */
  parts: Float32Array;
  triangles: number;
}

/** The geometries of all surfaces. */
export function sceneGeometry({ scene, plan }: Container): SurfaceGeometry[] {
  let [charts, parts] = [0, 0];
  return scene.surfaces.map((surface, s) => {
    const layout = plan.surfaces[s];
    const count = surface.corners.length;
    const out: SurfaceGeometry = {
      positions: new Float32Array(count * 3),
      normals: new Float32Array(count * 3),
      tangents: new Float32Array(count * 3),
      uvs: layout.uv,
      charts: new Float32Array(count),
      parts: new Float32Array(count),
      triangles: count / 3,
    };
    for (let t = 0, part = 0; t < out.triangles; t++) {
      while (t >= surface.parts[part].end) part++;
      addTriangle(out, t, surface.corners, scene.positions, plan.settings.frame);
      out.charts.fill(charts + layout.chart[t] + 1, t * 3, t * 3 + 3);
      out.parts.fill(parts + part, t * 3, t * 3 + 3);
    }
    if (surface.normals.length > 0) smoothCorners(out, surface, scene.normals, layout, plan.settings.frame);
    charts += 1 + layout.chart.reduce((max, c) => Math.max(max, c), 0);
    parts += surface.parts.length;
    return out;
  });
}

function addTriangle(out: SurfaceGeometry, t: number, indices: Uint32Array, positions: Float32Array, rule: 'texture' | 'thesis'): void {
  const corners = trianglePositions(positions, indices, t);
  const uv = [0, 1, 2].map((c): [number, number] => [out.uvs[t * 6 + c * 2], out.uvs[t * 6 + c * 2 + 1]]);
  const frame = frameOfTriangle(corners, uv, rule);
  for (let c = 0; c < 3; c++) {
    const v = t * 3 + c;
    out.positions.set(corners[c], v * 3);
    if (frame) {
      out.normals.set(frame.normal, v * 3);
      out.tangents.set(frame.tangent, v * 3);
    }
  }
}

/** The frame at a point of a triangle, given by its barycentric weights; null for a triangle without area. */
export function frameAt({ normals, tangents }: CornerFrames, triangle: number, weights: Vec3): Frame | null {
  const mix = (values: Float32Array) => weights.reduce<Vec3>((sum, w, c) => add(sum, scale(vec3At(values, triangle * 3 + c), w)), [0, 0, 0]);
  const normal = mix(normals);
  const size = length(normal);
  return size > 1e-6 ? orientedFrame(scale(normal, 1 / size), mix(tangents)) : null;
}

/** The corners of a triangle, metres. */
export function trianglePositions(positions: Float32Array, corners: Uint32Array, t: number): [Vec3, Vec3, Vec3] {
  const at = (c: number): Vec3 => vec3At(positions, corners[t * 3 + c]);
  return [at(0), at(1), at(2)];
}
