/**
 * Figures of the frame drawn last. Written four times a second at most: faster, nobody can read them, and writing them would cost frames.
 */

import type { KilnViewerElement, ViewerStats } from '../viewer/api.ts';
import { Terms, el } from './dom.ts';
import { bytes } from './format.ts';

const EVERY_MS = 250;

export class Statistics {
  readonly element: HTMLDetailsElement;
  private readonly terms = new Terms();
  private timer: number | undefined;

  constructor(private readonly viewer: KilnViewerElement) {
    this.element = el('details', { class: 'statistics' }, el('summary', {}, 'Statistics'), this.terms.element);
    this.element.addEventListener('toggle', () => this.write());
    for (const event of ['stats', 'model', 'load']) viewer.addEventListener(event, () => this.later());
    this.write();
  }

  toggle(): void {
    this.element.open = !this.element.open;
  }

  private later(): void {
    if (!this.element.open) return;
    this.timer ??= window.setTimeout(() => {
      this.timer = undefined;
      this.write();
    }, EVERY_MS);
  }

  private write(): void {
    if (!this.element.open) return;
    for (const [name, text] of statisticsRows(this.viewer.stats)) this.terms.set(name, text);
  }
}

/** The rows, in order; null leaves one out. */
export function statisticsRows(stats: ViewerStats): [string, string | null][] {
  const schemes = Object.entries(stats.schemes).map(([scheme, count]) => `${count} ${scheme}`);
  return [
    ['Frames per second', stats.fps > 0 ? stats.fps.toFixed(1) : 'at rest'],
    ['Last frame', `${stats.frameMs.toFixed(1)} ms`],
    ['Draw calls', String(stats.drawCalls)],
    ['Triangles drawn', stats.triangles.toLocaleString('en')],
    ['Texture memory', `${bytes(stats.textureBytes)} of ${bytes(stats.budgetBytes)}`],
    ['First picture', stats.firstPictureMs === null ? null : `${Math.round(stats.firstPictureMs)} ms`],
    ['Samples', stats.busy ? 'loading…' : null],
    ['Codec', stats.codec || null],
    ['Surfaces by scheme', schemes.length > 0 ? schemes.join(', ') : null],
  ];
}
