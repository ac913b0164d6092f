/**
 * The images of a scene, as far as a viewer needs them once their colours are baked: the mean of each, and of those that decide what shows through,
 * one channel. Whole images would be most of what a page holds, for nothing.
 */

import { EOTF } from '../field/decode.ts';
import type { ByteReader, Vec3 } from './bytes.ts';

/** One channel of an image, row 0 at v = 0, byte / 255. */
export interface Channel {
  width: number;
  height: number;
  bytes: Uint8Array;
}

/** Which channel: opacity is in alpha, KHR_materials_transmission in red. */
export type ChannelName = 'alpha' | 'red';

export interface SceneTexture {
  name: string;
  /** Mean linear colour and alpha, of up to {@link SAMPLES} texels. */
  mean: { colour: Vec3; alpha: number };
  /** Those that were asked for; an alpha that is 1 everywhere is none. */
  channels: Partial<Record<ChannelName, Channel>>;
}

const SAMPLES = 4096;

/** Reads the next image and keeps of it what `wanted` names. */
export function readTexture(r: ByteReader, wanted: ReadonlySet<ChannelName>): SceneTexture {
  const name = r.text('texture name');
  const [width, height] = [r.varint('texture width'), r.varint('texture height')];
  const coding = r.variant(['srgb', 'linear'] as const, 'texture coding');
  const channels = r.bool('texture alpha') ? 4 : 3;
  const bytes = r.take(r.length(1, 'texture'), 'texture');
  if (width * height === 0 || bytes.length !== width * height * channels) {
    throw r.error(`texture ${name} has ${bytes.length} bytes; ${width} x ${height} x ${channels} expected`);
  }
  const texture: SceneTexture = { name, mean: meanOf(bytes, channels, coding === 'srgb'), channels: {} };
  if (wanted.has('red')) texture.channels.red = { width, height, bytes: channelOf(bytes, channels, 0, coding === 'srgb') };
  if (wanted.has('alpha') && channels === 4) {
    const alpha = channelOf(bytes, channels, 3, false);
    if (alpha.some((v) => v !== 255)) texture.channels.alpha = { width, height, bytes: alpha };
  }
  return texture;
}

function channelOf(bytes: Uint8Array, channels: number, which: number, srgb: boolean): Uint8Array {
  const out = new Uint8Array(bytes.length / channels);
  for (let i = 0, j = which; i < out.length; i++, j += channels) out[i] = srgb ? Math.round(255 * EOTF[bytes[j]]) : bytes[j];
  return out;
}

function meanOf(bytes: Uint8Array, channels: number, srgb: boolean): SceneTexture['mean'] {
  const texels = bytes.length / channels;
  // An odd step meets every column of images whose width is a power of two.
  const step = Math.max(1, Math.floor(texels / SAMPLES)) | 1;
  const sum = [0, 0, 0, 0];
  let count = 0;
  for (let t = 0; t < texels; t += step, count++) {
    for (let c = 0; c < 3; c++) sum[c] += srgb ? EOTF[bytes[t * channels + c]] : bytes[t * channels + c] / 255;
    sum[3] += channels === 4 ? bytes[t * channels + 3] / 255 : 1;
  }
  return { colour: [sum[0] / count, sum[1] / count, sum[2] / count], alpha: sum[3] / count };
}
