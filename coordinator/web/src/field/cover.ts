/**
 * What shows through a surface: masks, blends and thin walls (docs/preview.md). Light fields say what a surface sends out itself; how much of what lies
 * behind is added to it is decided when it is drawn.
 *
 * Texture coordinates are brought to the corners here, those of a projector with their divisor: the shader looks up in one way, whatever they come from.
 * Coordinate sets as attributes of their own would be as many as a material has textures.
 */

import type { Vec3 } from '../format/bytes.ts';
import type { Container } from '../format/container.ts';
import type { Material, TextureRef, Wrap } from '../format/material.ts';
import type { Scene, SceneSurface } from '../format/scene.ts';
import type { Channel, ChannelName } from '../format/texture.ts';
import { meanColour } from './draft.ts';
import { type SurfaceGeometry } from './geometry.ts';
import { vec3At } from './frame.ts';

/** A channel of a texture as it is looked up. */
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

/** Triangles of a surface that are drawn alike. */
export interface Cover {
  /** Whether what lies behind is mixed in; else it is seen or not. */
  blended: boolean;
  /** Opacity below it is none, from it on it is whole; null for opacity that counts as it is. */
  cutoff: number | null;
  alpha: Sampled | null;
  /** Light that goes straight through where the surface is. */
  passing: Sampled | null;
  /** Reflectance at normal incidence: what is reflected does not go through. */
  fresnel: number;
  triangles: Uint32Array;
}

/** How a surface covers what lies behind it. */
export interface SurfaceCover {
  /** Triangles that cover all of it. */
  opaque: Uint32Array;
  covers: Cover[];
  /** Four numbers a vertex: u q, v q, q of the look-up (q = 0: none) and the factor on what is found there. */
  alphaAt: Float32Array;
  passingAt: Float32Array;
}

/** Squared roughness below which the worker takes a material for smooth; rougher ones scatter what goes through into their own light field. */
const SMOOTH = 1e-3;

/** Null for a surface that covers all. */
export function surfaceCover({ scene }: Container, index: number, geometry: SurfaceGeometry): SurfaceCover | null {
  const surface = scene.surfaces[index];
  const kinds = surface.parts.map((part) => kindOf(scene, surface, scene.materials[part.material]));
  if (kinds.every((kind) => kind === null)) return null;
  const groups = new Map<string, { kind: Omit<Cover, 'triangles'>; triangles: number[] }>();
  const opaque: number[] = [];
  const four = () => new Float32Array(geometry.triangles * 12);
  const out: SurfaceCover = { opaque: new Uint32Array(), covers: [], alphaAt: four(), passingAt: four() };
  let from = 0;
  surface.parts.forEach(({ end, material }, p) => {
    const kind = kinds[p];
    const key = JSON.stringify(kind);
    const group = kind ? (groups.get(key) ?? { kind, triangles: [] }) : null;
    if (group) groups.set(key, group);
    for (let t = from; t < end; t++) (group?.triangles ?? opaque).push(t);
    if (kind) writeLookUps(out, scene, surface, scene.materials[material], geometry.positions, from, end);
    from = end;
  });
  out.opaque = Uint32Array.from(opaque);
  out.covers = [...groups.values()].map(({ kind, triangles }) => ({ ...kind, triangles: Uint32Array.from(triangles) }));
  return out;
}

/** How a material is drawn on a surface; null where it covers all, whatever its author called it. */
function kindOf(scene: Scene, surface: SceneSurface, material: Material): Omit<Cover, 'triangles'> | null {
  const { opacity } = material;
  const sampled = (ref: TextureRef | null, channel: ChannelName): Sampled | null =>
    ref && scene.textures[ref.texture].channels[channel]
      ? { texture: ref.texture, channel, wrap: ref.wrap, nearest: ref.nearest, transform: ref.transform, projected: ref.mapping.from === 'projector' }
      : null;
  const mask = opacity.mode === 'mask';
  const alpha = opacity.mode === 'opaque' ? null : sampled(opacity.texture, 'alpha');
  const most = opacity.mode === 'opaque' ? 1 : opacity.factor;
  const whole = !alpha && !(opacity.mode !== 'opaque' && surface.alphas) && (mask ? most >= opacity.cutoff : most >= 1);
  const through = passingShare(scene, material) > 0;
  if (whole && !through) return null;
  const passing = through ? sampled(material.transmission?.texture ?? null, 'red') : null;
  const fresnel = through ? (material.transmission?.fresnel ?? 0) : 0;
  return { blended: through || opacity.mode === 'blend', cutoff: mask ? opacity.cutoff : null, alpha, passing, fresnel };
}

/** Share of the light from behind that goes through before the texture of the transmission and Fresnel's term, a mean over the channels. */
function passingShare(scene: Scene, material: Material): number {
  const { transmission } = material;
  if (!transmission || transmission.roughness ** 2 >= SMOOTH) return 0;
  const [r, g, b] = meanColour(scene, material);
  return (transmission.factor * (1 - transmission.metallic) * (r + g + b)) / 3;
}

function writeLookUps(out: SurfaceCover, scene: Scene, surface: SceneSurface, material: Material, positions: Float32Array, from: number, end: number): void {
  const { opacity, transmission } = material;
  const factor = opacity.mode === 'opaque' ? 1 : opacity.factor;
  const share = passingShare(scene, material);
  const opacityTexture = opacity.mode === 'opaque' ? null : opacity.texture;
  for (let v = from * 3; v < end * 3; v++) {
    const at = vec3At(positions, v);
    const alpha = opacity.mode === 'opaque' ? 1 : (surface.alphas?.[v] ?? 1);
    out.alphaAt.set([...lookUp(scene, surface, opacityTexture, v, at), factor * alpha], v * 4);
    out.passingAt.set([...lookUp(scene, surface, transmission?.texture ?? null, v, at), share], v * 4);
  }
}

/** Homogeneous coordinates (u q, v q, q) of a corner in a texture. */
function lookUp(scene: Scene, surface: SceneSurface, ref: TextureRef | null, v: number, [x, y, z]: Vec3): Vec3 {
  if (!ref) return [0, 0, 0];
  let [s, t, q] = [0, 0, 1];
  if (ref.mapping.from === 'uv') {
    const set = surface.uvSets.get(ref.mapping.index);
    if (set) [s, t] = [set[v * 2], set[v * 2 + 1]];
  } else {
    const m = scene.projectors[ref.mapping.index].matrix;
    [s, t, q] = [0, 4, 12].map((row) => m[row] * x + m[row + 1] * y + m[row + 2] * z + m[row + 3]);
  }
  return [s, t, q];
}

/** Opacity at a point of a triangle, given by its barycentric weights: what is picked there. Thin walls are there as a whole. */
export function opacityAt(scene: Scene, { alphaAt }: SurfaceCover, cover: Cover, triangle: number, weights: Vec3): number {
  const mixed = [0, 1, 2, 3].map((k) => weights.reduce((sum, w, c) => sum + w * alphaAt[(triangle * 3 + c) * 4 + k], 0));
  const [u, v, q, factor] = mixed;
  const { alpha } = cover;
  const channel = alpha && scene.textures[alpha.texture].channels[alpha.channel];
  const reached = q > 0 && !(alpha?.projected && [u / q, v / q].some((x) => x < 0 || x > 1));
  const opacity = factor * (alpha && channel && reached ? sampleChannel(channel, alpha, ...moved(alpha.transform, u / q, v / q)) : 1);
  return cover.cutoff === null ? opacity : opacity >= cover.cutoff ? 1 : 0;
}

const moved = ([a, b, c, d, e, f]: number[], u: number, v: number): [number, number] => [a * u + b * v + c, d * u + e * v + f];

/** What a texture unit finds at (u, v). */
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
