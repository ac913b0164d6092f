/**
 * Decoding blocks away from the page's thread: a quarter of a billion samples take seconds, and orbiting must not wait for them.
 *
 * Blocks carry their own samples, so that workers hold no state and any of them may take any block. Where workers cannot be had (a library
 * served from another origin, tests), blocks are decoded in place.
 */

import { type Block, type ExpandedBlock, expandBlock } from './decode.ts';
import type { ExpandRequest } from './expand.worker.ts';
import type { Grid } from './grid.ts';
import { cosineWeights, depthOfStep } from './grid.ts';
import type { Walk } from '../format/plan.ts';

/** Blocks handed to a worker before the first comes back: enough to keep it busy, few enough to bound memory. */
const AHEAD = 2;

/** A block on its way. */
interface Pending {
  request: ExpandRequest;
  hand: Hand;
  resolve: (block: ExpandedBlock) => void;
  reject: (error: Error) => void;
}

interface Hand {
  worker: Worker;
  busy: number;
}

export class ExpandPool {
  private hands: Hand[] = [];
  private waiting: (() => void)[] = [];
  private pending = new Map<number, Pending>();
  private nextId = 0;
  private disposed = false;

  constructor(size = Math.max(1, Math.min(4, (globalThis.navigator?.hardwareConcurrency ?? 2) - 1))) {
    try {
      for (let i = 0; i < size; i++) this.hands.push(this.hire());
    } catch {
      this.hands.splice(0).forEach((hand) => hand.worker.terminate());
    }
  }

  /** Blocks worth asking for at the same time. */
  get parallel(): number {
    return Math.max(1, this.hands.length * AHEAD);
  }

  /** Decodes a block; waits for a free worker first, so that callers may ask in a loop. */
  async expand(block: Block, grid: Grid, walk: Walk, layered: boolean): Promise<ExpandedBlock> {
    const [depthOf, weights] = [depthOfStep(grid, walk), cosineWeights(grid)];
    for (;;) {
      if (this.disposed) throw new DOMException('the viewer is gone', 'AbortError');
      if (this.hands.length === 0) return expandBlock(block, depthOf, weights, layered);
      const hand = this.hands.reduce((a, b) => (b.busy < a.busy ? b : a));
      if (hand.busy < AHEAD) return this.send(hand, { id: this.nextId++, block, depthOf, weights, layered });
      await new Promise<void>((resolve) => this.waiting.push(resolve));
    }
  }

  dispose(): void {
    this.disposed = true;
    this.hands.forEach((hand) => hand.worker.terminate());
    this.pending.forEach(({ reject }) => reject(new DOMException('the viewer is gone', 'AbortError')));
    this.pending.clear();
    this.wake();
  }

  private hire(): Hand {
    const worker = new Worker(new URL('./expand.worker.ts', import.meta.url), { type: 'module' });
    const hand = { worker, busy: 0 };
    worker.onmessage = ({ data }: MessageEvent<{ id: number; expanded: ExpandedBlock }>) => {
      hand.busy--;
      this.pending.get(data.id)?.resolve(data.expanded);
      this.pending.delete(data.id);
      this.wake();
    };
    worker.onerror = () => this.lose(hand);
    return hand;
  }

  private send(hand: Hand, request: ExpandRequest): Promise<ExpandedBlock> {
    hand.busy++;
    return new Promise((resolve, reject) => {
      this.pending.set(request.id, { request, hand, resolve, reject });
      hand.worker.postMessage(request);
    });
  }

  /** A worker that cannot be started, or fails, is let go; its blocks are decoded in place, where a fault of theirs shows. */
  private lose(hand: Hand): void {
    hand.worker.terminate();
    this.hands = this.hands.filter((other) => other !== hand);
    for (const [id, { request, hand: whose, resolve, reject }] of this.pending) {
      if (whose !== hand) continue;
      this.pending.delete(id);
      try {
        resolve(expandBlock(request.block, request.depthOf, request.weights, request.layered));
      } catch (error) {
        reject(error as Error);
      }
    }
    this.wake();
  }

  private wake(): void {
    this.waiting.splice(0).forEach((resolve) => resolve());
  }
}
