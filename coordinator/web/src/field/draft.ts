/** Colours of parts for the draft of a job that has only begun: what a material reflects and emits, its textures taken at their mean. */

import type { Vec3 } from '../format/bytes.ts';
import type { Material, TextureLayer } from '../format/material.ts';
import type { Scene } from '../format/scene.ts';

const map = (v: Vec3, each: (value: number, channel: number) => number): Vec3 => [each(v[0], 0), each(v[1], 1), each(v[2], 2)];

/** Kd or base colour of a material, its layers applied in order. */
export function meanColour({ textures }: Scene, { colour, layers }: Material): Vec3 {
  return layers.reduce<Vec3>((c, layer) => map(applied(c, layer, textures[layer.texture.texture].mean), (v) => Math.min(1, Math.max(0, v))), colour);
}

function applied(c: Vec3, { mode, scale }: TextureLayer, { colour: t, alpha }: { colour: Vec3; alpha: number }): Vec3 {
  switch (mode) {
    case 'modulate':
      return map(c, (v, k) => v * t[k] * scale);
    case 'replace':
      return t;
    case 'add':
      return map(c, (v, k) => v + t[k]);
    case 'add-signed':
      return map(c, (v, k) => v + t[k] - 0.5);
    case 'subtract':
      return map(c, (v, k) => v - t[k]);
    case 'blend':
      return map(c, (v, k) => t[k] * alpha + v * (1 - alpha));
  }
}

/** What a material reflects diffusely: its colour, less what goes through. Metals reflect their colour, too, if not diffusely. */
export function meanReflectance(scene: Scene, material: Material): Vec3 {
  const { transmission } = material;
  const kept = transmission ? 1 - transmission.factor * (1 - transmission.metallic) : 1;
  return map(meanColour(scene, material), (v) => v * kept);
}

/** Emitted radiance of a material, W/(sr m²). */
export function meanEmission({ textures }: Scene, { emission, emissionTexture }: Material): Vec3 {
  if (!emissionTexture) return emission;
  const { colour } = textures[emissionTexture.texture].mean;
  return map(emission, (v, k) => v * colour[k]);
}
