/**
 * Textures that decide what shows through, on the GPU: one channel or a colour, uploaded when something is first drawn with it. They have
 * their share of the memory budget; where they pass it, or the GPU's limits, the largest are halved until they fit: a mask that is coarse
 * shows what a mask that is missing hides.
 */

import {
  ClampToEdgeWrapping, DataTexture, LinearFilter, MirroredRepeatWrapping, NearestFilter, RGBAFormat, RedFormat, RepeatWrapping, SRGBColorSpace, UnsignedByteType,
} from 'three';
import type { Sampled } from '../field/cover.ts';
import type { GpuLimits } from '../field/layout.ts';
import type { Scene } from '../format/scene.ts';
import type { Channel } from '../format/texture.ts';

/** Share of the budget. */
const SHARE = 1 / 4;
const WRAP = { repeat: RepeatWrapping, mirror: MirroredRepeatWrapping, clamp: ClampToEdgeWrapping };

interface Held {
  texture: DataTexture;
  /** As in the scene. */
  whole: Channel;
}

export class ChannelTextures {
  private readonly held = new Map<string, Held>();
  /** Where nothing is looked up: covered all over. */
  private readonly none = dataTexture({ width: 1, height: 1, each: 1, srgb: false, bytes: Uint8Array.of(255) });

  constructor(private readonly scene: Scene, private readonly limits: GpuLimits) {}

  /** The texture of a look-up. */
  get(sampled: Sampled | null): DataTexture {
    const whole = sampled && this.scene.textures[sampled.texture].channels[sampled.channel];
    if (!sampled || !whole) return this.none;
    const key = JSON.stringify([sampled.texture, sampled.channel, sampled.wrap, sampled.nearest]);
    const held = this.held.get(key) ?? { texture: dataTexture(whole), whole };
    this.held.set(key, held);
    const { texture } = held;
    [texture.wrapS, texture.wrapT] = [WRAP[sampled.wrap[0]], WRAP[sampled.wrap[1]]];
    texture.minFilter = texture.magFilter = sampled.nearest ? NearestFilter : LinearFilter;
    return texture;
  }

  get bytes(): number {
    return [...this.held.values()].reduce((sum, { texture, whole }) => sum + texture.image.width * texture.image.height * whole.each, 0);
  }

  /** Makes them fit into their share of `budget` bytes and the GPU's limits. */
  fit(budget: number): void {
    const all = [...this.held.values()];
    const sizes = fitChannels(all.map(({ whole }) => whole), budget * SHARE, this.limits.maxTextureSize);
    all.forEach(({ texture, whole }, i) => {
      const halvings = sizes[i];
      if (texture.userData.halvings === halvings) return;
      let image = whole;
      for (let k = 0; k < halvings; k++) image = halve(image);
      texture.dispose();
      texture.image = { data: image.bytes as Uint8Array<ArrayBuffer>, width: image.width, height: image.height };
      texture.userData.halvings = halvings;
      texture.needsUpdate = true;
    });
  }

  dispose(): void {
    this.held.forEach(({ texture }) => texture.dispose());
    this.none.dispose();
  }
}

function dataTexture({ width, height, each, srgb, bytes }: Channel): DataTexture {
  const texture = new DataTexture(bytes as Uint8Array<ArrayBuffer>, width, height, each === 1 ? RedFormat : RGBAFormat, UnsignedByteType);
  if (srgb) texture.colorSpace = SRGBColorSpace;
  texture.unpackAlignment = 1;
  texture.userData.halvings = 0;
  texture.needsUpdate = true;
  return texture;
}

/** How often each image is halved so that all of them take at most `bytes` and no side is above `side`. */
export function fitChannels(images: Pick<Channel, 'width' | 'height' | 'each'>[], bytes: number, side: number): number[] {
  const at = (v: number, k: number) => Math.max(1, v >> k);
  const size = (i: number, k: number) => at(images[i].width, k) * at(images[i].height, k) * images[i].each;
  const halvings = images.map(({ width, height }) => Math.max(0, Math.ceil(Math.log2(Math.max(width, height) / side))));
  for (;;) {
    const sizes = halvings.map((k, i) => size(i, k));
    const most = sizes.indexOf(Math.max(...sizes));
    if (most < 0 || sizes[most] <= images[most].each || sizes.reduce((a, b) => a + b, 0) <= bytes) return halvings;
    halvings[most]++;
  }
}

/** Half as wide and high: means of four, of the bytes as they are coded. An odd last row or column is left out. */
export function halve({ width, height, each, srgb, bytes }: Channel): Channel {
  const [w, h] = [Math.max(1, width >> 1), Math.max(1, height >> 1)];
  const out = new Uint8Array(w * h * each);
  const at = (x: number, y: number, c: number) => bytes[(Math.min(y, height - 1) * width + Math.min(x, width - 1)) * each + c];
  for (let i = 0; i < out.length; i++) {
    const [c, t] = [i % each, Math.floor(i / each)];
    const [x, y] = [2 * (t % w), 2 * Math.floor(t / w)];
    out[i] = (at(x, y, c) + at(x + 1, y, c) + at(x, y + 1, c) + at(x + 1, y + 1, c) + 2) >> 2;
  }
  return { width: w, height: h, each, srgb, bytes: out };
}
