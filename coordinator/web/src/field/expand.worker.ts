/** A worker that decodes blocks: nothing but messages around `expandBlock`. */

import { type Block, expandBlock } from './decode.ts';

/** What the pool asks. */
export interface ExpandRequest {
  id: number;
  block: Block;
  depthOf: Uint16Array;
  weights: Float64Array;
  layered: boolean;
}

self.onmessage = ({ data }: MessageEvent<ExpandRequest>) => {
  const { id, block, depthOf, weights, layered } = data;
  const expanded = expandBlock(block, depthOf, weights, layered);
  const owned = [expanded.mean.buffer, ...(expanded.layers ? [expanded.layers.buffer] : [])];
  self.postMessage({ id, expanded }, { transfer: owned });
};
