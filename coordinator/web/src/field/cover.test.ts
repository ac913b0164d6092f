import { describe, expect, it } from 'vitest';
import type { Container } from '../format/container.ts';
import type { Material, TextureRef } from '../format/material.ts';
import type { Scene } from '../format/scene.ts';
import { opacityAt, sampleChannel, surfaceCover } from './cover.ts';
import type { SurfaceGeometry } from './geometry.ts';

const ref = (over: Partial<TextureRef> = {}): TextureRef => ({
  texture: 0, mapping: { from: 'uv', index: 0 }, transform: [1, 0, 0, 0, 1, 0], wrap: ['repeat', 'repeat'], nearest: true, ...over,
});
const material = (over: Partial<Material> = {}): Material => ({
  name: 'm', colour: [0.5, 0.5, 0.5], layers: [], emission: [0, 0, 0], emissionTexture: null,
  opacity: { mode: 'opaque', cutoff: 0, factor: 1, texture: null }, transmission: null, ...over,
});
const blend = (factor: number, texture: TextureRef | null = null) => material({ opacity: { mode: 'blend', cutoff: 0, factor, texture } });
const mask = (texture: TextureRef | null, cutoff = 0.5, factor = 1) => material({ opacity: { mode: 'mask', cutoff, factor, texture } });

/** A triangle for each material, each over the lower left half of the unit square of z = 0. */
function coverOf(materials: Material[], alphas: number[] | null = null, matrix?: number[]) {
  const corners = [0, 0, 0, 1, 0, 0, 0, 1, 0];
  const each = <T>(values: T[]): T[] => materials.flatMap(() => values);
  const texture = { name: 't', mean: { colour: [1, 1, 1], alpha: 0.5 }, channels: { alpha: { width: 2, height: 1, bytes: Uint8Array.of(255, 0) } } };
  const surface = {
    name: 's', parts: materials.map((_, i) => ({ name: 'p', material: i, end: i + 1 })), uvSets: new Map([[0, Float32Array.from(each([0, 0, 1, 0, 0, 1]))]]),
    alphas: alphas && Float32Array.from(each(alphas)),
  };
  const scene = { surfaces: [surface], materials, textures: [texture], projectors: matrix ? [{ matrix: Float32Array.from(matrix) }] : [] } as unknown as Scene;
  const geometry = { positions: Float32Array.from(each(corners)), triangles: materials.length } as unknown as SurfaceGeometry;
  return { scene, cover: surfaceCover({ scene } as Container, 0, geometry) };
}

/** Opacity at (u, v) of the triangle of a single material. */
function opacity(materials: Material, u: number, v: number, alphas: number[] | null = null, matrix?: number[]): number {
  const { scene, cover } = coverOf([materials], alphas, matrix);
  return opacityAt(scene, cover!, cover!.covers[0], 0, [1 - u - v, u, v]);
}

describe('what covers all', () => {
  it('is no cover, whatever its author called it', () => {
    for (const whole of [material(), blend(1), mask(null), material({ transmission: { factor: 1, texture: null, metallic: 1, roughness: 0, fresnel: 0 } })]) {
      expect(coverOf([whole]).cover).toBeNull();
    }
    // Rough glass scatters what goes through: that is in its light field.
    expect(coverOf([material({ transmission: { factor: 1, texture: null, metallic: 0, roughness: 0.2, fresnel: 0.04 } })]).cover).toBeNull();
  });

  it('is kept apart from what does not, which is grouped by how it is drawn', () => {
    const { cover } = coverOf([blend(0.5), material(), blend(0.25), mask(ref()), blend(0.5, ref())]);
    expect([...cover!.opaque]).toEqual([1]);
    expect(cover!.covers.map(({ blended, triangles }) => [blended, ...triangles])).toEqual([[true, 0, 2], [false, 3], [true, 4]]);
    expect([cover!.alphaAt[3], cover!.alphaAt[2 * 12 + 3]]).toEqual([0.5, 0.25]);
  });
});

describe('opacity', () => {
  it('is factor x texture x vertex colour', () => {
    expect(opacity(blend(0.5, ref()), 0.25, 0.1)).toBeCloseTo(0.5);
    expect(opacity(blend(0.5, ref()), 0.75, 0.1)).toBe(0);
    expect(opacity(blend(0.5), 0.5, 0, [1, 0, 1])).toBeCloseTo(0.25);
    expect(opacity(blend(1), 0.5, 0, [1, 0, 1])).toBeCloseTo(0.5);
  });

  it('of a mask is all or nothing, at the cutoff all', () => {
    expect([opacity(mask(ref()), 0.25, 0.1), opacity(mask(ref()), 0.75, 0.1)]).toEqual([1, 0]);
    expect(opacity(mask(ref(), 0.5, 0.5), 0.25, 0.1)).toBe(1);
    expect(opacity(mask(ref(), 0.5, 0.49), 0.25, 0.1)).toBe(0);
  });

  it('is looked up where the transform leads', () => {
    expect(opacity(blend(1, ref({ transform: [1, 0, 0.5, 0, 1, 0] })), 0.25, 0.1)).toBe(0);
    expect(opacity(blend(1, ref({ transform: [0, 1, 0, 1, 0, 0] })), 0.1, 0.75)).toBe(0);
  });

  it('through a projector is divided per point, and where that does not reach left alone', () => {
    // s q = x, q = 1 + x: x = 2/3 is s = 0.4, and x = 1 is s = 0.5.
    const matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1];
    const projected = blend(1, ref({ mapping: { from: 'projector', index: 0 } }));
    expect(opacity(projected, 0.66, 0, null, matrix)).toBe(1);
    expect(opacity(projected, 1, 0, null, matrix)).toBe(0);
    // Beside its picture, too: s q = 3 x.
    expect(opacity(projected, 1, 0, null, [3, ...matrix.slice(1)])).toBe(1);
    expect(opacity(projected, 0.9, 0, null, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1])).toBe(1);
  });
});

describe('a thin wall', () => {
  it('lets its transmission through, as far as it is no metal, tinted by its mean', () => {
    const wall = material({ colour: [1, 0.5, 0], transmission: { factor: 0.8, texture: null, metallic: 0.5, roughness: 0, fresnel: 0.04 } });
    const { cover } = coverOf([wall]);
    expect(cover!.covers[0]).toMatchObject({ blended: true, cutoff: null, fresnel: 0.04 });
    expect(cover!.passingAt[3]).toBeCloseTo(0.8 * 0.5 * 0.5);
    expect(cover!.alphaAt[3]).toBe(1);
  });
});

describe('a texture', () => {
  const image = { width: 4, height: 1, bytes: Uint8Array.of(0, 85, 170, 255) };
  const at = (u: number, wrap: 'repeat' | 'mirror' | 'clamp', nearest = true) => Math.round(3 * sampleChannel(image, { wrap: [wrap, wrap], nearest }, u, 0.5) * 100) / 100;

  it('goes on beyond its edges as it is told to', () => {
    expect([-0.1, 1.1, 1.3, 2.1].map((u) => at(u, 'repeat'))).toEqual([3, 0, 1, 0]);
    expect([-0.1, 1.1, 1.3, 2.1].map((u) => at(u, 'mirror'))).toEqual([0, 3, 2, 0]);
    expect([-0.1, 1.1, 1.3, 2.1].map((u) => at(u, 'clamp'))).toEqual([0, 3, 3, 3]);
  });

  it('is interpolated between the centres of its texels, across the edge too', () => {
    expect([0.125, 0.25, 0.5, 0, 1].map((u) => at(u, 'repeat', false))).toEqual([0, 0.5, 1.5, 1.5, 1.5]);
    expect([0, 1].map((u) => at(u, 'clamp', false))).toEqual([0, 3]);
  });
});
