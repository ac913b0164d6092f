/** Raw radiance for the GPU: bands of a `.mtex` in layers by direction. Which texels hold light, the codec's files say. */

import { DataUtils } from 'three';
import { FormatError } from '../format/bytes.ts';
import { openFile } from '../format/header.ts';
import type { FieldSurface } from '../field/light-field.ts';
import type { Layers } from './textures.ts';

/** 1 in half-float. */
const ONE = DataUtils.toHalfFloat(1);

/** The samples of a surface in bands of at most `bytes`. */
export function* rawLayers(file: Uint8Array, surface: FieldSurface, directions: number, bytes: number): Iterable<Layers> {
  const { width, height } = surface.plan;
  const name = `surfaces/${surface.fileStem}.mtex`;
  const { header, payload } = openFile(file, 'mtex', name);
  if (header.width !== width || header.height !== height || header.depth !== directions) {
    throw new FormatError(`${name}: it has another texture size or depth than the manifest says`);
  }
  const rows = Math.max(1, Math.floor(bytes / (width * directions * 4)));
  for (let y = 0; y < height; y += rows) {
    const band = Math.min(rows, height - y);
    const texels = width * band;
    const data = header.bits === 8 ? new Uint8Array(texels * directions * 4) : new Uint16Array(texels * directions * 4);
    const read = header.bits === 8 ? bytesAt(payload) : halvesAt(payload);
    const one = header.bits === 8 ? 255 : ONE;
    for (let t = 0; t < texels; t++) {
      if (!surface.source.texel(t % width, y + Math.floor(t / width))) continue;
      let from = (y * width + t) * directions * 3;
      for (let depth = 0; depth < directions; depth++, from += 3) {
        const to = (depth * texels + t) * 4;
        data[to] = read(from);
        data[to + 1] = read(from + 1);
        data[to + 2] = read(from + 2);
        data[to + 3] = one;
      }
    }
    yield { x: 0, y, width, height: band, data };
  }
}

const bytesAt = (payload: Uint8Array) => (i: number) => payload[i];

function halvesAt(payload: Uint8Array): (i: number) => number {
  const view = new DataView(payload.buffer, payload.byteOffset, payload.byteLength);
  return (i) => DataUtils.toHalfFloat(Math.min(65504, Math.max(0, view.getFloat32(i * 4, true))));
}
