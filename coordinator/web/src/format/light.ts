/** Lights without area, projectors and cameras of a scene (docs/formats.md). X3D's shadow fields are read over: they act in the bake. */

import type { ByteReader, Vec3 } from './bytes.ts';
import { readTextureOption } from './material.ts';

const PROFILES = ['linear', 'squared-cosine'] as const;

/** How a spot light fades between `beamWidth` and `cutOff`, half angles in radians. */
export interface Cone {
  beamWidth: number;
  cutOff: number;
  profile: (typeof PROFILES)[number];
}

/** A light; positions in metres, directions away from it. */
export type LightShape =
  | { kind: 'point'; position: Vec3 }
  | { kind: 'spot'; position: Vec3; direction: Vec3; cone: Cone }
  | { kind: 'directional'; direction: Vec3 };

/** How distance d weakens a light: 1/d² within a range (KHR_lights_punctual), or 1/max(a0 + a1 d + a2 d², 1) within a radius (X3D). */
export type Falloff = { kind: 'inverse-square'; range: number | null } | { kind: 'polynomial'; attenuation: Vec3; radius: number };

export interface Light {
  name: string;
  shape: LightShape;
  /** W/sr; directional: W/m². */
  intensity: Vec3;
  falloff: Falloff;
}

/** A camera or light through which a texture is projected. */
export interface Projector {
  /** Four rows of four: from world position (x, y, z, 1) to (s q, t q, r q, q). */
  matrix: Float32Array;
}

/** A camera of the author's. */
export interface SceneCamera {
  name: string;
  eye: Vec3;
  /** Unit. */
  forward: Vec3;
  up: Vec3;
  /** Vertical field of view, radians, or that of the smaller side; or half the height of an orthographic view, metres. */
  lens: { kind: 'perspective'; fov: number; ofSmaller: boolean } | { kind: 'orthographic'; halfHeight: number };
}

export function readLight(r: ByteReader): Light {
  const name = r.text('light name');
  const shape = readShape(r);
  const intensity = r.vec3('intensity');
  const falloff: Falloff =
    r.variant(['inverse-square', 'polynomial'] as const, 'falloff') === 'inverse-square'
      ? { kind: 'inverse-square', range: r.option(() => r.f32('range'), 'range') }
      : { kind: 'polynomial', attenuation: r.vec3('attenuation'), radius: r.f32('radius') };
  r.vec3('ambient');
  r.bool('shadows');
  r.f32('shadow intensity');
  // Near, far, up, rectangle, location, angle; which of them are automatic.
  r.skip(4 * (1 + 1 + 3 + 4 + 3 + 1) + 1, 'projection');
  r.option(() => readShadowMap(r), 'shadow map');
  readTextureOption(r);
  return { name, shape, intensity, falloff };
}

function readShape(r: ByteReader): LightShape {
  const kind = r.variant(['point', 'spot', 'directional'] as const, 'light');
  if (kind === 'directional') return { kind, direction: r.vec3('direction') };
  const position = r.vec3('position');
  if (kind === 'point') return { kind, position };
  const direction = r.vec3('direction');
  const [cutOff, beamWidth] = [r.f32('cut-off angle'), r.f32('beam width')];
  return { kind, position, direction, cone: { cutOff, beamWidth, profile: r.variant(PROFILES, 'spot profile') } };
}

/** Reads over a GeneratedShadowMap. */
export function readShadowMap(r: ByteReader): void {
  r.variant(['none', 'next-frame-only', 'always'], 'shadow update');
  r.varint('shadow size');
  r.skip(8, 'shadow offset');
  r.variant(['less-equal', 'greater-equal', 'none'], 'shadow comparison');
}

export function readProjector(r: ByteReader): Projector {
  r.text('projector name');
  r.option(() => r.varint('light'), 'light');
  return { matrix: r.floats(16, 'projector') };
}

export function readCamera(r: ByteReader): SceneCamera {
  const name = r.text('camera name');
  const [eye, forward, up] = [r.vec3('eye'), r.vec3('forward'), r.vec3('up')];
  const lens: SceneCamera['lens'] =
    r.variant(['perspective', 'orthographic'] as const, 'lens') === 'perspective'
      ? { kind: 'perspective', fov: r.f32('field of view'), ofSmaller: r.bool('field of view') }
      : { kind: 'orthographic', halfHeight: r.f32('half height') };
  return { name, eye, forward, up, lens };
}
