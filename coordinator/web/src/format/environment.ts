/**
 * The environment of a scene (docs/formats.md): what is seen where nothing else is. Its light is baked; kept is a picture of it that a
 * background needs and no more, since a lat-long map of a scene may well be larger than all the rest of it.
 */

import type { ByteReader, Vec3 } from './bytes.ts';

/**
 * Texels of the picture, at most: a sixth of a degree, which is almost three pixels of a view of 45 degrees and 720 rows, and as wide as
 * every GPU takes.
 */
const MOST = { width: 2048, height: 1024 };

export interface Environment {
  /** The file that it came from. */
  name: string;
  width: number;
  height: number;
  /** Linear radiance, three numbers a texel, W/(sr m²): row 0 straight down, the middle of a row toward +X, its right half toward +Z. */
  texels: Float32Array;
  /** Radians about +Y, taken off before the look-up. */
  rotation: number;
  /** Mean radiance over the sphere, W/(sr m²). */
  mean: Vec3;
}

/**
 * Reads an environment, its factor multiplied in. A map that is larger than {@link MOST} is averaged over the texels that fall together.
 */
export function readEnvironment(r: ByteReader): Environment {
  const name = r.text('environment name');
  const [width, height] = [r.varint('environment width'), r.varint('environment height')];
  const texels = r.length(12, 'environment');
  if (texels === 0 || texels !== width * height) throw r.error(`the environment has ${texels} texels; ${width} x ${height} expected`);
  const picture = pictureOf(r.take(texels * 12, 'environment'), width, height);
  const rotation = r.f32('rotation');
  const intensity = r.f32('environment intensity');
  for (let i = 0; i < picture.texels.length; i++) picture.texels[i] *= intensity;
  return { name, ...picture, rotation, mean: meanOf(picture) };
}

type Picture = Pick<Environment, 'width' | 'height' | 'texels'>;

function pictureOf(bytes: Uint8Array, fromWidth: number, fromHeight: number): Picture {
  const [width, height] = [Math.min(fromWidth, MOST.width), Math.min(fromHeight, MOST.height)];
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const texels = new Float32Array(width * height * 3);
  const [columns, rows] = [new Uint32Array(width), new Uint32Array(height)];
  const columnOf = (x: number) => Math.floor((x * width) / fromWidth);
  for (let x = 0; x < fromWidth; x++) columns[columnOf(x)]++;
  for (let y = 0, at = 0; y < fromHeight; y++) {
    const row = Math.floor((y * height) / fromHeight);
    rows[row]++;
    for (let x = 0; x < fromWidth; x++, at += 12) {
      const to = (row * width + columnOf(x)) * 3;
      for (let c = 0; c < 3; c++) texels[to + c] += view.getFloat32(at + c * 4, true);
    }
  }
  for (let i = 0; i < texels.length; i++) {
    const texel = Math.floor(i / 3);
    texels[i] /= columns[texel % width] * rows[Math.floor(texel / width)];
  }
  return { width, height, texels };
}

/** Rows are weighted by their share of the sphere. */
function meanOf({ width, height, texels }: Picture): Vec3 {
  const sum: Vec3 = [0, 0, 0];
  let all = 0;
  for (let y = 0; y < height; y++) {
    const weight = Math.cos(((y + 0.5) / height - 0.5) * Math.PI);
    all += weight * width;
    for (let i = y * width * 3; i < (y + 1) * width * 3; i++) sum[i % 3] += texels[i] * weight;
  }
  return [sum[0] / all, sum[1] / all, sum[2] / all];
}
