/**
 * How samples lie in textures, decided from the limits of the GPU before anything is allocated.
 *
 * *Array*: one layer a direction, W x H texels. Where there are more directions than layers, a layer holds a grid of cells, each one
 * direction; look-ups clamp to the cell, so that hardware filtering never mixes neighbours and no border is needed.
 * *Streams*: one-dimensional data unrolled into rows of 2,048, and into layers where rows run out.
 */

import { FormatError } from '../format/bytes.ts';

export interface GpuLimits {
  maxTextureSize: number;
  maxArrayLayers: number;
}

export interface ArrayLayout {
  /** Cells along x and y of a layer. */
  cellsX: number;
  cellsY: number;
  layers: number;
  /** Texels of a layer. */
  width: number;
  height: number;
}

/** Lays `directions` images of `width` x `height` into an array texture; null where no arrangement fits the limits. */
export function arrayLayout(width: number, height: number, directions: number, limits: GpuLimits): ArrayLayout | null {
  if (width > limits.maxTextureSize || height > limits.maxTextureSize) return null;
  const cells = Math.ceil(directions / limits.maxArrayLayers);
  const cellsX = Math.min(cells, Math.floor(limits.maxTextureSize / width));
  const cellsY = Math.ceil(cells / cellsX);
  if (cellsY * height > limits.maxTextureSize) return null;
  return { cellsX, cellsY, layers: Math.ceil(directions / (cellsX * cellsY)), width: cellsX * width, height: cellsY * height };
}

/** Bytes of an array texture at `bytesPerTexel`. */
export const arrayBytes = (layout: ArrayLayout, bytesPerTexel: number): number => layout.width * layout.height * layout.layers * bytesPerTexel;

export const STREAM_LOG_WIDTH = 11;
export const STREAM_WIDTH = 1 << STREAM_LOG_WIDTH;

export interface StreamLayout {
  /** Rows of a layer: a power of two where there are several layers. */
  rows: number;
  layers: number;
  /** log2(rows) with several layers, else 30: no element is beyond the first. */
  logRows: number;
}

/** Unrolls `count` elements. */
export function streamLayout(count: number, limits: GpuLimits): StreamLayout {
  const rows = Math.max(1, Math.ceil(count / STREAM_WIDTH));
  if (rows <= limits.maxTextureSize) return { rows, layers: 1, logRows: 30 };
  const logRows = Math.floor(Math.log2(limits.maxTextureSize));
  const layers = Math.ceil(rows / 2 ** logRows);
  if (layers > limits.maxArrayLayers) {
    throw new FormatError(`${count} samples are more than this GPU's textures hold (${limits.maxTextureSize} x ${limits.maxArrayLayers} layers)`);
  }
  return { rows: 2 ** logRows, layers, logRows };
}

/** Elements that the texture of a layout holds. */
export const streamCapacity = (layout: StreamLayout): number => STREAM_WIDTH * layout.rows * layout.layers;
