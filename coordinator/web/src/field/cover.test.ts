import { describe, expect, it } from 'vitest';
import type { Container } from '../format/container.ts';
import { readFileSync } from 'node:fs';
import { LEAST_ALPHA, type Material, type TextureRef, type Transmission } from '../format/material.ts';
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
const glass = (over: Partial<Transmission> = {}): Transmission => ({
  factor: 1, texture: null, metallic: 0, roughness: 0, metallicRoughness: null, specular: 1, specularTexture: null, reflectance: [0.04, 0.04, 0.04],
  reflectanceTexture: null, ...over,
});
const blend = (factor: number, texture: TextureRef | null = null) => material({ opacity: { mode: 'blend', cutoff: 0, factor, texture } });
const mask = (texture: TextureRef | null, cutoff = 0.5, factor = 1) => material({ opacity: { mode: 'mask', cutoff, factor, texture } });

/** A triangle for each material, each over the lower left half of the unit square of z = 0. */
function coverOf(materials: Material[], colours: number[] | null = null, matrix?: number[]) {
  const corners = [0, 0, 0, 1, 0, 0, 0, 1, 0];
  const each = <T>(values: T[]): T[] => materials.flatMap(() => values);
  const size = { width: 2, height: 1 };
  const channels = {
    alpha: { ...size, each: 1, srgb: false, bytes: Uint8Array.of(255, 0) }, colour: { ...size, each: 4, srgb: false, bytes: Uint8Array.of(255, 51, 255, 255, 255, 255, 0, 255) },
  };
  const texture = { name: 't', mean: { colour: [1, 0.6, 0.5], alpha: 0.5 }, least: [1, 0.2, 0], channels };
  const surface = {
    name: 's', parts: materials.map((_, i) => ({ name: 'p', material: i, end: i + 1 })), uvSets: new Map([[0, Float32Array.from(each([0, 0, 1, 0, 0, 1]))]]),
    colours: colours && Float32Array.from(each(colours)),
  };
  const scene = { surfaces: [surface], materials, textures: [texture], projectors: matrix ? [{ matrix: Float32Array.from(matrix) }] : [] } as unknown as Scene;
  const geometry = { positions: Float32Array.from(each(corners)), triangles: materials.length } as unknown as SurfaceGeometry;
  return { scene, cover: surfaceCover({ scene } as Container, 0, geometry) };
}

/** Opacity at (u, v) of the triangle of a single material. */
function opacity(materials: Material, u: number, v: number, alphas: number[] | null = null, matrix?: number[]): number {
  const { scene, cover } = coverOf([materials], alphas && alphas.flatMap((a) => [1, 1, 1, a]), matrix);
  return opacityAt(scene, cover!, cover!.covers[0], 0, [1 - u - v, u, v]);
}

describe('what covers all', () => {
  it('is no cover, whatever its author called it', () => {
    const metal = material({ transmission: glass({ metallic: 1 }) });
    const black = material({ colour: [0, 0, 0], transmission: glass() });
    for (const whole of [material(), blend(1), mask(null), metal, black]) expect(coverOf([whole]).cover).toBeNull();
    // Rough glass scatters what goes through: that is in its light field.
    expect(coverOf([material({ transmission: glass({ roughness: 0.2 }) })]).cover).toBeNull();
    expect(coverOf([material({ transmission: glass({ roughness: 0.2, metallicRoughness: ref() }) })]).cover, 'rough all over its texture').toBeNull();
  });

  it('is kept apart from what does not, which is grouped by how it is drawn', () => {
    const { cover } = coverOf([blend(0.5), material(), blend(0.25), mask(ref()), blend(0.5, ref())]);
    expect([...cover!.opaque]).toEqual([1]);
    expect(cover!.covers.map(({ blended, triangles }) => [blended, ...triangles])).toEqual([[true, 0, 2], [false, 3], [true, 4]]);
    expect([cover!.at[3], cover!.at[2 * 12 + 3]]).toEqual([0.5, 0.25]);
    expect([...Object.keys(cover!.lookUps)]).toEqual(['opacity']);
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

describe('clear glass', () => {
  const layers = (mode: 'modulate' | 'add') => [{ texture: ref(), mode, scale: 1 }] as const;
  const only = (transmission: Partial<Transmission>, over: Partial<Material> = {}, colours: number[] | null = null) =>
    coverOf([material({ colour: [1, 1, 1], transmission: glass(transmission), ...over })], colours).cover!;

  it('is told the terms of its reflection one by one: strength, and the largest channel at normal incidence', () => {
    const cover = only({ factor: 0.8, metallic: 0.5, specular: 0.5, reflectance: [0.02, 0.08, 0.04] });
    expect(cover.covers[0]).toMatchObject({ blended: true, cutoff: null, glass: { transmission: 0.8, metallic: 0.5, specular: 0.5, normal: 0.08, tinted: false } });
    expect([...cover.at.subarray(0, 4)]).toEqual([1, 1, 1, 1]);
    // Its textures at their mean.
    const textured = only({ specularTexture: ref(), reflectance: [0.1, 0.1, 0.1], reflectanceTexture: ref() }).covers[0].glass!;
    expect([textured.specular, textured.normal]).toEqual([0.5, 0.1]);
  });

  it('is smooth where its texture says so', () => {
    const cover = only({ roughness: 0.1, metallic: 1, metallicRoughness: ref() });
    expect(cover.covers[0]).toMatchObject({ glass: { roughness: 0.1, metallic: 1 }, textures: { roughness: { channel: 'colour' }, transmission: null, tint: null } });
    expect([...cover.lookUps.roughness!.subarray(0, 6)]).toEqual([0, 0, 1, 1, 0, 1]);
    // At most 0.2 times as rough, and no metal somewhere.
    expect(coverOf([material({ transmission: glass({ roughness: 0.16, metallicRoughness: ref() }) })]).cover).toBeNull();
    expect(coverOf([material({ transmission: glass({ roughness: 0.15, metallic: 1, metallicRoughness: ref() }) })]).cover).not.toBeNull();
  });

  it('tints with its colour, vertex colours and texture; with a stack of textures at its mean', () => {
    const tinted = (cover: ReturnType<typeof only>) => [cover.covers[0].glass!.tinted, cover.covers[0].textures.tint !== null, ...cover.at.subarray(0, 4)];
    expect(tinted(only({}, { colour: [1, 0.5, 0.25] }))).toEqual([true, false, 1, 0.5, 0.25, 1]);
    expect(tinted(only({}, {}, [1, 0.5, 1, 0.5, 1, 1, 1, 1, 1, 1, 1, 1]))).toEqual([true, false, 1, 0.5, 1, 1]);
    expect(tinted(only({}, { colour: [0.5, 0.5, 0.5], layers: [...layers('modulate')] }))).toEqual([true, true, 0.5, 0.5, 0.5, 1]);
    expect(tinted(only({}, { colour: [0, 0, 0], layers: [...layers('add')] }))).toEqual([true, false, 1, Math.fround(0.6), 0.5, 1]);
  });

  it('begins at the smoothness where the worker and `kiln render` have it begin', () => {
    const source = (path: string, pattern: RegExp) => Number(pattern.exec(readFileSync(new URL(`../../../../${path}`, import.meta.url), 'utf8'))?.[1]);
    expect(source('proto/src/scene/veil.rs', /pub const LEAST_ALPHA: f32 = ([\d.e-]+);/)).toBe(LEAST_ALPHA);
    expect(source('shaders/lf_cover.glsl', /const float LF_LEAST_ALPHA = ([\d.e-]+);/)).toBe(LEAST_ALPHA);
    const smooth = (roughness: number) => coverOf([material({ transmission: glass({ roughness }) })]).cover !== null;
    expect([smooth(Math.sqrt(LEAST_ALPHA) * 0.999), smooth(Math.sqrt(LEAST_ALPHA) * 1.001)]).toEqual([true, false]);
  });
});

describe('a texture', () => {
  const image = { width: 4, height: 1, each: 1, srgb: false, bytes: Uint8Array.of(0, 85, 170, 255) } as const;
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
