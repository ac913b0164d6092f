import { describe, expect, it } from 'vitest';
import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import { dot, length, sub, vec3At } from './frame.ts';
import { frameAt, sceneGeometry } from './geometry.ts';
import { vertexNumbers } from './smooth.ts';

interface Change {
  chart?: number[];
  uv?: (uv: number[], triangle: number) => number[];
  normal?: (normal: Vec3, vertex: number) => Vec3;
  rule?: 'texture' | 'thesis';
}

/**
 * The arc of the Rust crate's tests: `n` quads around a quarter of a cylinder of radius 1 about z, u along the arc, normals away from the
 * axis.
 */
function arc(n: number, { chart, uv = (c) => c, normal = (v) => v, rule = 'texture' }: Change = {}) {
  const [positions, normals, corners, coordinates]: number[][] = [[], [], [], []];
  for (let i = 0; i <= n; i++) {
    const [s, c] = [Math.sin((Math.PI / 2) * (i / n)), Math.cos((Math.PI / 2) * (i / n))];
    for (const z of [0, 1]) {
      normals.push(...normal([c, s, 0], positions.length / 3));
      positions.push(c, s, z);
    }
    if (i === n) continue;
    [[0, 2, 3], [0, 3, 1]].forEach((triangle, half) => {
      corners.push(...triangle.map((k) => 2 * i + k));
      coordinates.push(...uv(triangle.flatMap((k) => [(i + Math.floor(k / 2)) / n, 1 - (k % 2)]), 2 * i + half));
    });
  }
  const surface = { name: 's', parts: [{ name: 's', material: 0, end: 2 * n }], corners: Uint32Array.from(corners), normals: Uint32Array.from(corners) };
  const layout = { uv: Float32Array.from(coordinates), chart: Uint32Array.from(chart ?? Array(2 * n).fill(0)) };
  const scene = { positions: Float32Array.from(positions), normals: Float32Array.from(normals), surfaces: [surface] };
  return sceneGeometry({ scene, plan: { surfaces: [layout], settings: { frame: rule } } } as unknown as Container)[0];
}

const near = (a: Vec3, b: Vec3) => expect(length(sub(a, b)), `${a} and ${b}`).toBeLessThan(1e-6);

describe('a smooth surface', () => {
  it('turns evenly and does not jump at its edges', () => {
    const smooth = arc(6);
    for (let t = 0; t < 12; t++) {
      const far: Vec3 = t % 2 === 0 ? [0, 0, 1] : [0, 1, 0];
      for (const [weights, turned] of [[[1, 0, 0], 0], [far, 1]] as [Vec3, number][]) {
        const angle = ((Math.floor(t / 2) + turned) * Math.PI) / 12;
        const frame = frameAt(smooth, t, weights)!;
        near(frame.normal, [Math.cos(angle), Math.sin(angle), 0]);
        expect(length(sub(frame.tangent, [-Math.sin(angle), Math.cos(angle), 0]))).toBeLessThan(0.14);
        expect(Math.abs(dot(frame.tangent, frame.normal))).toBeLessThan(1e-6);
      }
    }
    // Both triangles of a quad have the same tangent where they meet.
    near(vec3At(smooth.tangents, 0), vec3At(smooth.tangents, 3));
  });

  it('does not mix the tangents of different charts and of cut edges', () => {
    const upsideDown = (c: number[], t: number) => (t === 1 ? c.map((v) => 1 - v) : c);
    const whole = frameAt(arc(1), 0, [1, 0, 0])!.tangent;
    for (const chart of [[0, 1], [0, 0]]) {
      const cut = arc(1, { chart, uv: upsideDown });
      near(frameAt(cut, 0, [1, 0, 0])!.tangent, whole);
      near(frameAt(cut, 1, [1, 0, 0])!.tangent, [-whole[0], -whole[1], -whole[2]]);
    }
  });

  it('falls back where something is degenerate', () => {
    near(frameAt(arc(1, { rule: 'thesis' }), 0, [1, 0, 0])!.tangent, [0, -1, 0]);
    near(frameAt(arc(1, { uv: (c) => c.map(() => 0.5) }), 0, [1, 0, 0])!.tangent, [0, -1, 0]);
    // Normals that point to the back, or nowhere, give way to the triangle's own.
    const bent = arc(1, { normal: (v, vertex) => (vertex === 0 ? [-1, 0, 0] : vertex === 3 ? [0, 0, 0] : v) });
    const own: Vec3 = [Math.SQRT1_2, Math.SQRT1_2, 0];
    near(frameAt(bent, 0, [1, 0, 0])!.normal, own);
    near(frameAt(bent, 0, [0, 0, 1])!.normal, own);
    near(frameAt(bent, 0, [0, 1, 0])!.normal, [0, 1, 0]);
  });
});

it('vertices are one where chart, position and coordinates are', () => {
  const corners = Uint32Array.of(0, 1, 2, 0, 2, 1, 0, 1, 2);
  const uv = Float32Array.of(0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 1, 0.5, 0, 0, 1, 0, 0, 1);
  expect([...vertexNumbers(corners, { chart: Uint32Array.of(0, 0, 1), uv })]).toEqual([0, 1, 2, 0, 2, 5, 6, 7, 8]);
  const many = Uint32Array.from({ length: 30_000 }, (_, i) => i % 1000);
  const numbers = vertexNumbers(many, { chart: new Uint32Array(10_000), uv: new Float32Array(60_000) });
  expect(numbers.every((v, i) => v === i % 1000)).toBe(true);
});
