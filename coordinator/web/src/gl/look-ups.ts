/** What `lf_cover.glsl` looks up to find what shows through: the one list of its names, for attributes, uniforms and defaults alike. */

import { BufferAttribute, type DataTexture, type IUniform, Vector3 } from 'three';
import type { Cover, LookUp, Sampled, SurfaceCover } from '../field/cover.ts';

/** Of each: where it is looked up, in what, and the map of the coordinates. In the order of `lfProjected`. */
export const LOOK_UPS = {
  opacity: { attribute: 'alphaAt', sampler: 'lfAlpha', move: 'lfAlphaMove' },
  transmission: { attribute: 'passingAt', sampler: 'lfPassing', move: 'lfPassingMove' },
  roughness: { attribute: 'roughnessAt', sampler: 'lfRoughness', move: 'lfRoughnessMove' },
  tint: { attribute: 'tintAt', sampler: 'lfTint', move: 'lfTintMove' },
} as const satisfies Record<LookUp, { attribute: string; sampler: string; move: string }>;

const NAMES = Object.keys(LOOK_UPS) as LookUp[];

/** What a mesh has where it does not have a look-up: nowhere. */
export const NOWHERE = Object.fromEntries(NAMES.map((name) => [LOOK_UPS[name].attribute, [0, 0, 0]]));

/** Those that no cover of a surface has stay away. */
export function lookUpAttributes(of: SurfaceCover['lookUps']): Record<string, BufferAttribute> {
  const out: Record<string, BufferAttribute> = {};
  for (const name of NAMES) {
    const places = of[name];
    if (places) out[LOOK_UPS[name].attribute] = new BufferAttribute(places, 3);
  }
  return out;
}

export function lookUpUniforms(textures: Cover['textures'], textureOf: (sampled: Sampled | null) => DataTexture): Record<string, IUniform> {
  const out: Record<string, IUniform> = { lfProjected: { value: NAMES.map((name) => Number(textures[name]?.projected ?? false)) } };
  for (const name of NAMES) {
    out[LOOK_UPS[name].sampler] = { value: textureOf(textures[name]) };
    out[LOOK_UPS[name].move] = { value: rowsOf(textures[name]) };
  }
  return out;
}

/** Rows of the map of a look-up's coordinates. */
function rowsOf(sampled: Sampled | null): Vector3[] {
  const [a, b, c, d, e, f] = sampled?.transform ?? [1, 0, 0, 0, 1, 0];
  return [new Vector3(a, b, c), new Vector3(d, e, f)];
}
