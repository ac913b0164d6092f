/**
 * When frames are drawn, and how long they take. On demand: a request draws once at the next animation frame, and a page at rest costs
 * nothing. A frame's time runs from its submission to the moment the GPU has finished it, which a fence tells in every browser; timer
 * queries would be finer and are switched off in many.
 */

/** Frames further apart than this do not follow each other. */
const PAUSE_MS = 400;

export class Frames {
  lastMs = 0;
  private rate = 0;
  private rest = 0;
  private asked = 0;
  private previous = 0;
  private readonly gl: WebGL2RenderingContext;
  private readonly draw: (now: number) => void;
  private readonly finished: () => void;
  private fence: { sync: WebGLSync; began: number } | null = null;

  /** `draw` submits a frame; `finished` is told when it is done. */
  constructor(gl: WebGL2RenderingContext, draw: (now: number) => void, finished: () => void) {
    this.gl = gl;
    this.draw = draw;
    this.finished = finished;
  }

  /** Frames a second while they follow each other; 0 at rest. */
  get fps(): number {
    return performance.now() - this.previous < PAUSE_MS ? this.rate : 0;
  }

  /** Asks for a frame. */
  request(): void {
    if (this.asked === 0) this.asked = requestAnimationFrame((now) => this.frame(now));
  }

  stop(): void {
    cancelAnimationFrame(this.asked);
    clearTimeout(this.rest);
    this.asked = 0;
    this.fence = null;
  }

  /** Draws `count` frames, each finished before the next begins; their milliseconds. */
  benchmark(count: number): number[] {
    const pixel = new Uint8Array(4);
    return Array.from({ length: count }, () => {
      const began = performance.now();
      this.draw(began);
      // Reading a pixel waits for the frame; `finish` may not.
      this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, pixel);
      return performance.now() - began;
    });
  }

  private frame(now: number): void {
    this.asked = 0;
    const gap = now - this.previous;
    this.previous = now;
    this.rate = gap < PAUSE_MS ? (this.rate === 0 ? 1000 / gap : 0.8 * this.rate + 0.2 * (1000 / gap)) : 0;
    clearTimeout(this.rest);
    // One last word when the view has come to rest.
    this.rest = window.setTimeout(this.finished, PAUSE_MS + 50);
    const began = performance.now();
    this.draw(now);
    if (this.fence) return;
    const sync = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
    if (!sync) return;
    this.fence = { sync, began };
    this.poll();
  }

  private poll(): void {
    const { gl, fence } = this;
    if (!fence) return;
    const state = gl.clientWaitSync(fence.sync, 0, 0);
    if (state === gl.TIMEOUT_EXPIRED) {
      setTimeout(() => this.poll(), 2);
      return;
    }
    gl.deleteSync(fence.sync);
    this.fence = null;
    this.lastMs = performance.now() - fence.began;
    this.finished();
  }
}
