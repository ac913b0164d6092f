/**
 * The materials of a scene (docs/formats.md). Their light is baked; what the viewer needs is what is not in it: how much of what lies
 * behind shows through, and colours for the draft of a job that has only begun. Everything else is read over.
 */

import type { ByteReader, Vec3 } from './bytes.ts';
import type { SceneTexture } from './texture.ts';

const WRAPS = ['repeat', 'mirror', 'clamp'] as const;
const MODES = ['modulate', 'replace', 'add', 'add-signed', 'subtract', 'blend'] as const;

/** What lies beyond the unit square of a texture. */
export type Wrap = (typeof WRAPS)[number];

/** A texture as a material uses it. */
export interface TextureRef {
  /** Index into the scene's textures. */
  texture: number;
  /** Where its coordinates come from: a set of the surface, or the world position through a projector. */
  mapping: { from: 'uv' | 'projector'; index: number };
  /** Rows of an affine map of the coordinates: u' = m[0] u + m[1] v + m[2], v' = m[3] u + m[4] v + m[5]. */
  transform: number[];
  /** Along u and v. */
  wrap: [Wrap, Wrap];
  nearest: boolean;
}

/** One texture of a stack: how its colour t and alpha a change the colour c so far. */
export interface TextureLayer {
  texture: TextureRef;
  mode: (typeof MODES)[number];
  /** Of mode `modulate`: c t s. */
  scale: number;
}

/** Light that goes through a thin wall (KHR_materials_transmission), and what decides how much of it goes straight on. */
export interface Transmission {
  factor: number;
  /** Its red channel multiplies the factor. */
  texture: TextureRef | null;
  metallic: number;
  roughness: number;
  /** Its green channel multiplies the roughness, its blue one the metalness. */
  metallicRoughness: TextureRef | null;
  /** Strength of the reflection (KHR_materials_specular), before its texture. */
  specular: number;
  specularTexture: TextureRef | null;
  /** What the ior reflects at normal incidence, tinted, before its texture. */
  reflectance: Vec3;
  reflectanceTexture: TextureRef | null;
}

/**
 * Squared roughness below which a surface is perfectly smooth; rougher ones scatter what goes through into their own light field. As
 * `LEAST_ALPHA` in `proto::scene` and `LF_LEAST_ALPHA` in `lf_cover.glsl`.
 */
export const LEAST_ALPHA = 1e-3;

/** Whether a material may be clear glass somewhere: transmissive, smooth and no metal, at the least values that its texture has. */
export function mayBeClear({ transmission: t }: Pick<Material, 'transmission'>, textures: readonly Pick<SceneTexture, 'least'>[]): boolean {
  if (!t) return false;
  const texture = t.metallicRoughness?.texture;
  const [, roughness, metallic] = texture === undefined ? [1, 1, 1] : (textures[texture]?.least ?? [0, 0, 0]);
  return (t.roughness * roughness) ** 2 < LEAST_ALPHA && t.metallic * metallic < 1;
}

export interface Opacity {
  mode: 'opaque' | 'mask' | 'blend';
  /** Of mode `mask`. */
  cutoff: number;
  factor: number;
  /** Its alpha channel multiplies the factor. */
  texture: TextureRef | null;
}

export interface Material {
  name: string;
  /** Kd or base colour, before its layers; black where nothing is reflected. */
  colour: Vec3;
  layers: TextureLayer[];
  /** Radiance, W/(sr m²), before its texture. */
  emission: Vec3;
  emissionTexture: TextureRef | null;
  opacity: Opacity;
  /** null for materials that let nothing through by themselves. */
  transmission: Transmission | null;
}

type Reflection = Pick<Material, 'colour' | 'layers' | 'transmission'>;

export function readMaterial(r: ByteReader): Material {
  const name = r.text('material name');
  const read = r.variant([readUnlit, readPhong, readMetallicRoughness], 'reflection');
  const reflection = read(r);
  const emission = r.vec3('emission');
  const emissionTexture = readTextureOption(r);
  const mode = r.variant(['opaque', 'mask', 'blend'] as const, 'opacity');
  const cutoff = mode === 'mask' ? r.f32('cutoff') : 0;
  const opacity = { mode, cutoff, factor: r.f32('opacity'), texture: readTextureOption(r) };
  r.option(() => {
    readTextureRef(r);
    r.f32('normal scale');
  }, 'normal map');
  return { name, ...reflection, emission, emissionTexture, opacity };
}

const readUnlit = (): Reflection => ({ colour: [0, 0, 0], layers: [], transmission: null });

function readPhong(r: ByteReader): Reflection {
  const colour = r.vec3('diffuse');
  const layers = readLayers(r);
  r.vec3('specular');
  readTextureOption(r);
  if (r.variant(['phong', 'mirror'] as const, 'lobe') === 'phong') r.f32('exponent');
  r.f32('ambient');
  return { colour, layers, transmission: null };
}

function readMetallicRoughness(r: ByteReader): Reflection {
  const colour = r.vec3('base colour');
  const layers = readLayers(r);
  const [metallic, roughness] = [r.f32('metallic'), r.f32('roughness')];
  const metallicRoughness = readTextureOption(r);
  const [ior, specular] = [r.f32('ior'), r.f32('specular')];
  const specularTexture = readTextureOption(r);
  const tint = r.vec3('specular colour');
  const reflectanceTexture = readTextureOption(r);
  const factor = r.f32('transmission');
  const texture = readTextureOption(r);
  const normal = ((ior - 1) / (ior + 1)) ** 2;
  const reflectance: Vec3 = [tint[0] * normal, tint[1] * normal, tint[2] * normal];
  const transmission = { factor, texture, metallic, roughness, metallicRoughness, specular, specularTexture, reflectance, reflectanceTexture };
  return { colour, layers, transmission: factor > 0 ? transmission : null };
}

const readLayers = (r: ByteReader): TextureLayer[] =>
  r.list(30, 'texture layers', () => {
    const texture = readTextureRef(r);
    const mode = r.variant(MODES, 'layer mode');
    return { texture, mode, scale: mode === 'modulate' ? r.f32('layer scale') : 1 };
  });

export const readTextureOption = (r: ByteReader): TextureRef | null => r.option(() => readTextureRef(r), 'texture');

function readTextureRef(r: ByteReader): TextureRef {
  const texture = r.varint('texture');
  const mapping = { from: r.variant(['uv', 'projector'] as const, 'mapping'), index: r.varint('mapping') };
  const transform = [...r.floats(6, 'texture transform')];
  const wrap: [Wrap, Wrap] = [r.variant(WRAPS, 'wrap'), r.variant(WRAPS, 'wrap')];
  return { texture, mapping, transform, wrap, nearest: r.bool('nearest') };
}
