/**
 * The textures of the schemes. All are allocated empty and filled by regions, so that a finished package, a tile that has just arrived and
 * a context that was lost and came back take one way, and no copy of what is on the GPU stays in memory.
 */

import {
  Box3, ClampToEdgeWrapping, Data3DTexture, DataArrayTexture, DataTexture, HalfFloatType, LinearFilter, NearestFilter, NoColorSpace,
  type PixelFormat, RGBAFormat, RGBAIntegerFormat, RedIntegerFormat, type Texture, type TextureDataType, UnsignedByteType, UnsignedIntType,
  UnsignedShortType, Vector3, type WebGLRenderer, DataUtils,
} from 'three';
import type { ExpandedBlock } from '../field/decode.ts';
import { type ArrayLayout, type GpuLimits, STREAM_WIDTH, arrayBytes, streamCapacity, streamLayout } from '../field/layout.ts';
import type { CodedSurface } from '../format/coded.ts';

/** A texture with what it costs. */
export interface Held<T extends Texture> {
  texture: T;
  bytes: number;
}

function settle<T extends Texture>(texture: T, format: PixelFormat, type: TextureDataType, internalFormat: string, linear: boolean): T {
  texture.format = format;
  texture.type = type;
  texture.internalFormat = internalFormat as T['internalFormat'];
  texture.minFilter = linear ? LinearFilter : NearestFilter;
  texture.magFilter = linear ? LinearFilter : NearestFilter;
  texture.wrapS = ClampToEdgeWrapping;
  texture.wrapT = ClampToEdgeWrapping;
  texture.generateMipmaps = false;
  texture.unpackAlignment = 1;
  texture.flipY = false;
  texture.colorSpace = NoColorSpace;
  // Storage is allocated without data: WebGL clears it to zero, which is "no light here".
  texture.source.dataReady = false;
  texture.needsUpdate = true;
  return texture;
}

/** Samples by direction, 8-bit sRGB or half-float linear. */
export function sampleTexture(layout: ArrayLayout, linear: boolean): Held<DataArrayTexture> {
  const texture = new DataArrayTexture(null, layout.width, layout.height, layout.layers);
  settle(texture, RGBAFormat, linear ? HalfFloatType : UnsignedByteType, linear ? 'RGBA16F' : 'SRGB8_ALPHA8', true);
  return { texture, bytes: arrayBytes(layout, linear ? 8 : 4) };
}

/** A rectangle of texels, all directions: D images of width x height, RGBA. */
export interface Layers {
  x: number;
  y: number;
  width: number;
  height: number;
  data: Uint8Array | Uint16Array;
}

/** Writes a rectangle into a {@link sampleTexture} of surfaces of `surfaceWidth` x `surfaceHeight`. */
export function writeLayers(
  renderer: WebGLRenderer,
  texture: DataArrayTexture,
  layout: ArrayLayout,
  surface: { width: number; height: number },
  directions: number,
  layers: Layers,
): void {
  const { x, y, width, height, data } = layers;
  const cells = layout.cellsX * layout.cellsY;
  const image = width * height * 4;
  for (let cell = 0; cell < cells; cell++) {
    // Directions cell, cell + cells, ... lie at the same place of successive layers.
    const count = Math.ceil((directions - cell) / cells);
    if (count <= 0) break;
    const packed = cells === 1 ? data : gather(data, image, cell, cells, count);
    const source = new Data3DTexture(packed as Uint8Array<ArrayBuffer>, width, height, count);
    source.format = texture.format;
    source.type = texture.type;
    const at = new Vector3((cell % layout.cellsX) * surface.width + x, Math.floor(cell / layout.cellsX) * surface.height + y, 0);
    renderer.copyTextureToTexture(source, texture, new Box3(new Vector3(), new Vector3(width, height, count)), at);
  }
}

function gather(data: Uint8Array | Uint16Array, image: number, first: number, stride: number, count: number): Uint8Array | Uint16Array {
  const out = data instanceof Uint8Array ? new Uint8Array(image * count) : new Uint16Array(image * count);
  for (let k = 0; k < count; k++) out.set(data.subarray((first + k * stride) * image, (first + k * stride + 1) * image), k * image);
  return out;
}

/** One linear value a texel. */
export function meanTexture(width: number, height: number): Held<DataTexture> {
  const texture = settle(new DataTexture(null, width, height), RGBAFormat, HalfFloatType, 'RGBA16F', true);
  return { texture, bytes: width * height * 8 };
}

/** Writes a rectangle of RGBA floats into a {@link meanTexture}. */
export function writeMean(renderer: WebGLRenderer, texture: DataTexture, block: ExpandedBlock): void {
  const source = new DataTexture(toHalf(block.mean) as Uint16Array<ArrayBuffer>, block.width, block.height, RGBAFormat, HalfFloatType);
  renderer.copyTextureToTexture(source, texture, null, new Vector3(block.x, block.y, 0));
}

/** Half floats; what is too bright for them (65,504) is cut, since infinity would spoil every interpolation. */
export function toHalf(values: Float32Array): Uint16Array {
  return Uint16Array.from(values, (v) => DataUtils.toHalfFloat(Math.min(65504, Math.max(0, v))));
}

/** The kept samples as integer textures. */
export interface StreamTextures {
  starts: DataArrayTexture;
  steps: DataArrayTexture;
  colours: DataArrayTexture;
  /** null: colours are direct. */
  map: DataArrayTexture | null;
  logRows: [number, number, number];
  bytes: number;
}

/** Bytes that {@link streamTextures} takes. */
export function streamBytes(coded: CodedSurface, limits: GpuLimits): number {
  const capacity = (count: number) => streamCapacity(streamLayout(count, limits));
  const samples = capacity(coded.steps.length);
  return capacity(coded.starts.length) * 4 + samples * (coded.indices ? 4 : 6) + (coded.indices ? capacity(coded.rgb.length / 3) * 4 : 0);
}

/** Unrolls a surface's kept samples into textures. */
export function streamTextures(renderer: WebGLRenderer, coded: CodedSurface, limits: GpuLimits): StreamTextures {
  const [starts, startsLog] = unrolled(renderer, coded.starts, limits, RedIntegerFormat, UnsignedIntType, 'R32UI');
  const [steps, stepsLog] = unrolled(renderer, coded.steps, limits, RedIntegerFormat, UnsignedShortType, 'R16UI');
  const rgba = withAlpha(coded.rgb);
  const [first] = coded.indices
    ? unrolled(renderer, coded.indices, limits, RedIntegerFormat, UnsignedShortType, 'R16UI')
    : unrolled(renderer, rgba, limits, RGBAIntegerFormat, UnsignedByteType, 'RGBA8UI');
  const [map, mapLog] = coded.indices ? unrolled(renderer, rgba, limits, RGBAIntegerFormat, UnsignedByteType, 'RGBA8UI') : [null, 30];
  return { starts, steps, colours: first, map, logRows: [startsLog, stepsLog, mapLog], bytes: streamBytes(coded, limits) };
}

/** Three bytes a texel are no format that integer textures have on every GPU. */
function withAlpha(rgb: Uint8Array): Uint8Array {
  const out = new Uint8Array((rgb.length / 3) * 4);
  for (let i = 0, j = 0; i < rgb.length; i += 3, j += 4) {
    out[j] = rgb[i];
    out[j + 1] = rgb[i + 1];
    out[j + 2] = rgb[i + 2];
  }
  return out;
}

type Words = Uint8Array | Uint16Array | Uint32Array;

function unrolled(
  renderer: WebGLRenderer, data: Words, limits: GpuLimits, format: PixelFormat, type: TextureDataType, internalFormat: string,
): [DataArrayTexture, number] {
  const each = format === RGBAIntegerFormat ? 4 : 1;
  const { rows, layers, logRows } = streamLayout(data.length / each, limits);
  const texture = settle(new DataArrayTexture(null, STREAM_WIDTH, rows, layers), format, type, internalFormat, false);
  const layer = STREAM_WIDTH * rows * each;
  for (let k = 0; k < layers; k++) {
    const part = data.subarray(k * layer, (k + 1) * layer);
    const used = Math.ceil(part.length / (STREAM_WIDTH * each));
    if (used === 0) continue;
    // Whole rows: the last one is filled up.
    const padded = part.length === used * STREAM_WIDTH * each ? part : pad(part, used * STREAM_WIDTH * each);
    const source = new Data3DTexture(padded as Uint8Array<ArrayBuffer>, STREAM_WIDTH, used, 1);
    source.format = format as typeof source.format;
    source.type = type;
    renderer.copyTextureToTexture(source, texture, new Box3(new Vector3(), new Vector3(STREAM_WIDTH, used, 1)), new Vector3(0, 0, k));
  }
  return [texture, logRows];
}

function pad(data: Words, length: number): Words {
  const out = data instanceof Uint8Array ? new Uint8Array(length) : data instanceof Uint16Array ? new Uint16Array(length) : new Uint32Array(length);
  out.set(data);
  return out;
}
