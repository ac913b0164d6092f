/**
 * What shows through a surface: masks, blends and clear glass (docs/preview.md). Light fields say what a surface sends out itself; how much
 * of what lies behind is added to it is decided when it is drawn.
 *
 * Texture coordinates are brought to the corners here, those of a projector with their divisor: the shader looks up in one way, whatever
 * they come from. Coordinate sets as attributes of their own would be as many as a material has textures.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import { type Material, type TextureRef, type Wrap, mayBeClear } from '../format/material.ts';
import { type CoverTexture, type CoverTextures, type Scene, type SceneSurface, coverTextures } from '../format/scene.ts';
import type { Channel, ChannelName } from '../format/texture.ts';
import { meanColour } from './draft.ts';
import { type SurfaceGeometry } from './geometry.ts';
import { vec3At } from './frame.ts';

/** Channels of a texture as they are looked up. */
export interface Sampled {
  texture: number;
  channel: ChannelName;
  wrap: [Wrap, Wrap];
  nearest: boolean;
  /** Affine map of the coordinates, as in {@link TextureRef}. */
  transform: number[];
  /** Through a projector: beside its picture nothing is looked up. */
  projected: boolean;
}

/** Smooth, thin glass: what goes straight through it is its colour, less what it reflects (`Scene::glass_at` in `proto::scene::veil`). */
export interface Glass {
  transmission: number;
  roughness: number;
  metallic: number;
  /** Strength of the reflection, and what is reflected at normal incidence before it. */
  specular: number;
  normal: number;
  /** Whether it lets other shares of red, green and blue through. */
  tinted: boolean;
}

/** What is looked up to find what shows through. */
export type LookUp = keyof CoverTextures;

/** Triangles of a surface that are drawn alike. */
export interface Cover {
  /** Whether what lies behind is mixed in; else it is seen or not. */
  blended: boolean;
  /** Opacity below it is none, from it on it is whole; null for opacity that counts as it is. */
  cutoff: number | null;
  /** What is looked up; null for what is not, or says nothing. */
  textures: Record<LookUp, Sampled | null>;
  /** null where nothing goes through but past the opacity. */
  glass: Glass | null;
  triangles: Uint32Array;
}

type Kind = Omit<Cover, 'triangles'>;

/** How a surface covers what lies behind it. */
export interface SurfaceCover {
  /** Triangles that cover all of it. */
  opaque: Uint32Array;
  covers: Cover[];
  /** Four numbers a vertex: colour of what glass lets through and opacity, both before textures. */
  at: Float32Array;
  /** Three numbers a vertex for each look-up that some of its covers have: u q, v q, q. */
  lookUps: Partial<Record<LookUp, Float32Array>>;
}

/** Null for a surface that covers all. */
export function surfaceCover({ scene }: Container, index: number, geometry: SurfaceGeometry): SurfaceCover | null {
  const surface = scene.surfaces[index];
  const vertices = vertexColours(surface);
  const ofMaterial = new Map<number, Kind | null>();
  for (const { material } of surface.parts) {
    if (!ofMaterial.has(material)) ofMaterial.set(material, kindOf(scene, vertices, scene.materials[material]));
  }
  const kinds = surface.parts.map(({ material }) => ofMaterial.get(material) ?? null);
  if (kinds.every((kind) => kind === null)) return null;
  const groups = new Map<string, { kind: Kind; triangles: number[] }>();
  const opaque: number[] = [];
  const out: SurfaceCover = { opaque: new Uint32Array(), covers: [], at: new Float32Array(geometry.triangles * 12), lookUps: {} };
  let from = 0;
  surface.parts.forEach(({ end, material }, p) => {
    const kind = kinds[p];
    const key = JSON.stringify(kind);
    const group = kind ? (groups.get(key) ?? { kind, triangles: [] }) : null;
    if (group) groups.set(key, group);
    for (let t = from; t < end; t++) (group?.triangles ?? opaque).push(t);
    if (kind) writeVertices(out, scene, surface, scene.materials[material], kind, geometry.positions, from, end);
    from = end;
  });
  out.opaque = Uint32Array.from(opaque);
  out.covers = [...groups.values()].map(({ kind, triangles }) => ({ ...kind, triangles: Uint32Array.from(triangles) }));
  return out;
}

/** Whether some vertex colour is not opaque, and some not grey. */
function vertexColours({ colours }: SceneSurface): { fade: boolean; tint: boolean } {
  const out = { fade: false, tint: false };
  for (let i = 0; colours && i < colours.length; i += 4) {
    out.fade ||= colours[i + 3] < 1;
    out.tint ||= colours[i] !== colours[i + 1] || colours[i] !== colours[i + 2];
  }
  return out;
}

/** How a material is drawn on a surface; null where it covers all, whatever its author called it. */
function kindOf(scene: Scene, vertices: { fade: boolean; tint: boolean }, material: Material): Kind | null {
  const { opacity } = material;
  const mask = opacity.mode === 'mask';
  const looked = coverTextures(material, scene.textures);
  const glass = glassOf(scene, material, looked, vertices.tint);
  const sampled = (it: CoverTexture | null): Sampled | null =>
    it && scene.textures[it.ref.texture].channels[it.channel]
      ? {
          texture: it.ref.texture, channel: it.channel, wrap: it.ref.wrap, nearest: it.ref.nearest, transform: it.ref.transform,
          projected: it.ref.mapping.from === 'projector',
        }
      : null;
  const ofGlass = (it: CoverTexture | null) => (glass ? sampled(it) : null);
  const alpha = sampled(looked.opacity);
  const most = opacity.mode === 'opaque' ? 1 : opacity.factor;
  const whole = !alpha && !(opacity.mode !== 'opaque' && vertices.fade) && (mask ? most >= opacity.cutoff : most >= 1);
  if (whole && !glass) return null;
  const textures = { opacity: alpha, transmission: ofGlass(looked.transmission), roughness: ofGlass(looked.roughness), tint: ofGlass(looked.tint) };
  return { blended: glass !== null || opacity.mode === 'blend', cutoff: mask ? opacity.cutoff : null, textures, glass };
}

/**
 * Null for what is clear nowhere: rough, metal or black. Textures of the reflection are taken at their mean, which few would tell from the
 * truth.
 */
function glassOf(scene: Scene, material: Material, looked: CoverTextures, tintedVertices: boolean): Glass | null {
  const { transmission: t } = material;
  const [r, g, b] = meanColour(scene, material);
  if (!t || !mayBeClear(material, scene.textures) || Math.max(r, g, b) <= 0) return null;
  const mean = (ref: TextureRef | null) => (ref ? scene.textures[ref.texture].mean : { colour: [1, 1, 1], alpha: 1 });
  const { colour } = mean(t.reflectanceTexture);
  return {
    transmission: t.factor,
    roughness: t.roughness,
    metallic: t.metallic,
    specular: t.specular * mean(t.specularTexture).alpha,
    normal: Math.min(1, Math.max(...t.reflectance.map((v, c) => v * colour[c]))),
    tinted: looked.tint !== null || tintedVertices || r !== g || g !== b,
  };
}

function writeVertices(
  out: SurfaceCover, scene: Scene, surface: SceneSurface, material: Material, kind: Kind, positions: Float32Array, from: number, end: number,
): void {
  const { opacity, colour } = material;
  const looked = coverTextures(material, scene.textures);
  // What is not looked up is at its mean; vertex colours count once for all.
  const base = looked.tint ? colour : meanColour(scene, material);
  const solid = opacity.mode === 'opaque';
  for (let v = from * 3; v < end * 3; v++) {
    const [r, g, b, a] = surface.colours?.subarray(v * 4, v * 4 + 4) ?? [1, 1, 1, 1];
    out.at.set([base[0] * r, base[1] * g, base[2] * b, solid ? 1 : opacity.factor * a], v * 4);
  }
  for (const name of Object.keys(looked) as LookUp[]) {
    const it = looked[name];
    if (!it || !kind.textures[name]) continue;
    const places = (out.lookUps[name] ??= new Float32Array((out.at.length / 4) * 3));
    for (let v = from * 3; v < end * 3; v++) places.set(lookUp(scene, surface, it.ref, v, vec3At(positions, v)), v * 3);
  }
}

/** Homogeneous coordinates (u q, v q, q) of a corner in a texture. */
function lookUp(scene: Scene, surface: SceneSurface, { mapping }: TextureRef, v: number, [x, y, z]: Vec3): Vec3 {
  if (mapping.from === 'uv') {
    const set = surface.uvSets.get(mapping.index);
    return set ? [set[v * 2], set[v * 2 + 1], 1] : [0, 0, 1];
  }
  const m = scene.projectors[mapping.index].matrix;
  const [s, t, q] = [0, 4, 12].map((row) => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3]);
  return [s, t, q];
}

/** Opacity at a point of a triangle, given by its barycentric weights: what is picked there. Clear glass is there as a whole. */
export function opacityAt(scene: Scene, { at, lookUps }: SurfaceCover, cover: Cover, triangle: number, weights: Vec3): number {
  const mix = (values: Float32Array, each: number, k: number) => weights.reduce((sum, w, c) => sum + w * values[(triangle * 3 + c) * each + k], 0);
  const factor = mix(at, 4, 3);
  const alpha = cover.textures.opacity;
  const channel = alpha && scene.textures[alpha.texture].channels[alpha.channel];
  const places = lookUps.opacity;
  const [u, v, q] = places ? [0, 1, 2].map((k) => mix(places, 3, k)) : [0, 0, 0];
  const reached = q > 0 && !(alpha?.projected && [u / q, v / q].some((x) => x < 0 || x > 1));
  const opacity = factor * (alpha && channel && reached ? sampleChannel(channel, alpha, ...moved(alpha.transform, u / q, v / q)) : 1);
  return cover.cutoff === null ? opacity : opacity >= cover.cutoff ? 1 : 0;
}

const moved = ([a, b, c, d, e, f]: number[], u: number, v: number): [number, number] => [a * u + b * v + c, d * u + e * v + f];

/** What a texture unit finds at (u, v) in a texture of one channel. */
export function sampleChannel({ width, height, bytes }: Channel, { wrap, nearest }: Pick<Sampled, 'wrap' | 'nearest'>, u: number, v: number): number {
  const at = (x: number, y: number) => bytes[wrapped(y, height, wrap[1]) * width + wrapped(x, width, wrap[0])] / 255;
  const [x, y] = [u * width, v * height];
  if (nearest) return at(Math.floor(x), Math.floor(y));
  const [i, j] = [Math.floor(x - 0.5), Math.floor(y - 0.5)];
  const [fx, fy] = [x - 0.5 - i, y - 0.5 - j];
  const row = (k: number) => at(i, k) * (1 - fx) + at(i + 1, k) * fx;
  return row(j) * (1 - fy) + row(j + 1) * fy;
}

function wrapped(i: number, size: number, wrap: Wrap): number {
  if (wrap === 'clamp') return Math.min(size - 1, Math.max(0, i));
  const period = wrap === 'mirror' ? 2 * size : size;
  const k = ((i % period) + period) % period;
  return k < size ? k : period - 1 - k;
}
