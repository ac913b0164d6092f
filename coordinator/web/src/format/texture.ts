/**
 * The images of a scene, as far as a viewer needs them once their colours are baked: the mean of each, and the channels that decide what
 * shows through. Whole images would be most of what a page holds, for nothing.
 */

import { EOTF } from '../field/decode.ts';
import type { ByteReader, Vec3 } from './bytes.ts';

/** Some channels of an image, row 0 at v = 0. */
export interface Channel {
  width: number;
  height: number;
  /** Bytes a texel: one channel, byte / 255, or red, green, blue and 255. */
  each: 1 | 4;
  /** Whether red, green and blue of four are sRGB-coded; a single channel never is. */
  srgb: boolean;
  bytes: Uint8Array;
}

/** Which channels: opacity is in alpha, KHR_materials_transmission in red; roughness, metalness and colours take all three. */
export type ChannelName = 'alpha' | 'red' | 'colour';

export interface SceneTexture {
  name: string;
  /** Mean linear colour and alpha, of up to {@link SAMPLES} texels. */
  mean: { colour: Vec3; alpha: number };
  /** The least linear value of each colour, where that was asked for. */
  least: Vec3 | null;
  /** Those that were asked for; an alpha that is 1 everywhere is none. */
  channels: Partial<Record<ChannelName, Channel>>;
}

/** An image as it lies in the file, not copied. */
export interface Image {
  name: string;
  width: number;
  height: number;
  srgb: boolean;
  /** Bytes a texel: three colours, and alpha where there is one. */
  each: 3 | 4;
  bytes: Uint8Array;
}

const SAMPLES = 4096;

export function readImage(r: ByteReader): Image {
  const name = r.text('texture name');
  const [width, height] = [r.varint('texture width'), r.varint('texture height')];
  const coding = r.variant(['srgb', 'linear'] as const, 'texture coding');
  const each = r.bool('texture alpha') ? 4 : 3;
  const bytes = r.take(r.length(1, 'texture'), 'texture');
  if (width * height === 0 || bytes.length !== width * height * each) {
    throw r.error(`texture ${name} has ${bytes.length} bytes; ${width} x ${height} x ${each} expected`);
  }
  return { name, width, height, srgb: coding === 'srgb', each, bytes };
}

/** Copies of the channels of an image that `wanted` names. */
export function channelsOf({ width, height, srgb, each, bytes }: Image, wanted: ReadonlySet<ChannelName>): SceneTexture['channels'] {
  const out: SceneTexture['channels'] = {};
  const one = { width, height, each: 1, srgb: false } as const;
  if (wanted.has('red')) out.red = { ...one, bytes: channelOf(bytes, each, 0, srgb) };
  if (wanted.has('colour')) out.colour = { width, height, each: 4, srgb, bytes: coloursOf(bytes, each) };
  if (wanted.has('alpha') && each === 4) {
    const alpha = channelOf(bytes, each, 3, false);
    if (alpha.some((v) => v !== 255)) out.alpha = { ...one, bytes: alpha };
  }
  return out;
}

function channelOf(bytes: Uint8Array, channels: number, which: number, srgb: boolean): Uint8Array {
  const out = new Uint8Array(bytes.length / channels);
  for (let i = 0, j = which; i < out.length; i++, j += channels) out[i] = srgb ? Math.round(255 * EOTF[bytes[j]]) : bytes[j];
  return out;
}

/** Three bytes a texel are no format that every GPU filters. */
function coloursOf(bytes: Uint8Array, channels: number): Uint8Array {
  const out = new Uint8Array((bytes.length / channels) * 4).fill(255);
  for (let i = 0, j = 0; i < out.length; i += 4, j += channels) {
    for (let c = 0; c < 3; c++) out[i + c] = bytes[j + c];
  }
  return out;
}

export function meanOf({ srgb, each, bytes }: Image): SceneTexture['mean'] {
  const texels = bytes.length / each;
  // An odd step meets every column of images whose width is a power of two.
  const step = Math.max(1, Math.floor(texels / SAMPLES)) | 1;
  const sum = [0, 0, 0, 0];
  let count = 0;
  for (let t = 0; t < texels; t += step, count++) {
    for (let c = 0; c < 3; c++) sum[c] += srgb ? EOTF[bytes[t * each + c]] : bytes[t * each + c] / 255;
    sum[3] += each === 4 ? bytes[t * each + 3] / 255 : 1;
  }
  return { colour: [sum[0] / count, sum[1] / count, sum[2] / count], alpha: sum[3] / count };
}

/** The least linear value of each colour, of all texels. */
export function leastOf({ srgb, each, bytes }: Image): Vec3 {
  const least: Vec3 = [255, 255, 255];
  for (let i = 0; i < bytes.length; i += each) {
    for (let c = 0; c < 3; c++) if (bytes[i + c] < least[c]) least[c] = bytes[i + c];
  }
  const linear = (byte: number) => (srgb ? EOTF[byte] : byte / 255);
  return [linear(least[0]), linear(least[1]), linear(least[2])];
}
