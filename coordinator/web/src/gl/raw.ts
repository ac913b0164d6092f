/** Raw radiance for the GPU: bands of a `.mtex` in layers by direction. Which texels hold light, the codec's files say. */

import { DataUtils } from 'three';
import { FormatError } from '../format/bytes.ts';
import { openFile } from '../format/header.ts';
import { type FieldSurface, type LightField, fieldDirections } from '../field/light-field.ts';
import type { Layers } from './textures.ts';

/** 1 in half-float. */
const ONE = DataUtils.toHalfFloat(1);
/** The largest half-float. */
const MOST = 65504;

/**
 * The samples of a surface in bands of at most `bytes`. Linear ones are multiplied by `factor`, 2^stops, before they become half floats:
 * dim and bright scenes keep their precision where it shows.
 */
export function* rawLayers(file: Uint8Array, surface: FieldSurface, directions: number, factor: number, bytes: number): Iterable<Layers> {
  const { width, height } = surface.plan;
  const name = `surfaces/${surface.fileStem}.mtex`;
  const { header, payload } = openFile(file, 'mtex', name);
  if (header.width !== width || header.height !== height || header.depth !== directions) {
    throw new FormatError(`${name}: it has another texture size or depth than the manifest says`);
  }
  const rows = Math.max(1, Math.floor(bytes / (width * directions * 4)));
  for (let y = 0; y < height; y += rows) {
    const band = Math.min(rows, height - y);
    const lit = Uint8Array.from({ length: width * band }, (_, t) => (surface.source.texel(t % width, y + Math.floor(t / width)) ? 1 : 0));
    const [from, to] = [y, y + band].map((row) => row * width * directions * 3 * (header.bits / 8));
    const part = payload.subarray(from, to);
    yield { x: 0, y, width, height: band, data: header.bits === 8 ? bytesOf(part, lit, directions) : halves(floats(part), lit, directions, factor) };
  }
}

/**
 * Loads the raw radiance of a surface and hands it over in bands of at most `bytes`, as long as `wanted` says so. Whether it came to its
 * end.
 */
export async function writeRaw(
  field: LightField, surface: FieldSurface, bytes: number, wanted: () => boolean, write: (layers: Layers) => void,
): Promise<boolean> {
  if (!field.loadRaw) throw new Error('the package kept no raw radiance; bake with --raw u8 or --raw f32');
  const file = await field.loadRaw(surface.index);
  for (const layers of rawLayers(file, surface, fieldDirections(field), 2 ** field.exposureStops, bytes)) {
    if (!wanted()) return false;
    write(layers);
    // A breath between bands: the view must not freeze while hundreds of megabytes are sorted.
    await new Promise((resolve) => setTimeout(resolve));
  }
  return wanted();
}

/** From texel by texel to direction by direction. */
function bytesOf(part: Uint8Array, lit: Uint8Array, directions: number): Uint8Array {
  const texels = lit.length;
  const out = new Uint8Array(texels * directions * 4);
  for (let t = 0, from = 0; t < texels; t++) {
    for (let depth = 0; depth < directions; depth++, from += 3) {
      if (!lit[t]) continue;
      const to = (depth * texels + t) * 4;
      out[to] = part[from];
      out[to + 1] = part[from + 1];
      out[to + 2] = part[from + 2];
      out[to + 3] = 255;
    }
  }
  return out;
}

/** The same in half floats; what is too bright for them is cut. */
export function halves(part: Float32Array, lit: Uint8Array, directions: number, factor: number): Uint16Array {
  const texels = lit.length;
  const out = new Uint16Array(texels * directions * 4);
  const half = (v: number) => DataUtils.toHalfFloat(Math.min(MOST, v * factor));
  for (let t = 0, from = 0; t < texels; t++) {
    for (let depth = 0; depth < directions; depth++, from += 3) {
      if (!lit[t]) continue;
      const to = (depth * texels + t) * 4;
      out[to] = half(part[from]);
      out[to + 1] = half(part[from + 1]);
      out[to + 2] = half(part[from + 2]);
      out[to + 3] = ONE;
    }
  }
  return out;
}

/** Little-endian floats, copied: a file may lie anywhere in its buffer. */
function floats(payload: Uint8Array): Float32Array {
  const out = new Float32Array(payload.length / 4);
  const view = new DataView(payload.buffer, payload.byteOffset, payload.byteLength);
  for (let i = 0; i < out.length; i++) out[i] = view.getFloat32(i * 4, true);
  return out;
}
