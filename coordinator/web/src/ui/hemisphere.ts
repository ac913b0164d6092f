/**
 * The light of one texel toward all directions, as a disc seen from above it: the picture that tells a highlight from noise. `polar.ts` has
 * the geometry. Drawn on a canvas: a grid may have thousands of sectors, and as SVG each would be an element.
 */

import type { TexelSample } from '../viewer/api.ts';
import { el, setText } from './dom.ts';
import { radiance } from './format.ts';
import { type Sector, neighbour, sectorAt, sectorBounds, sectorDirection, sectorIndex, toDisc } from './polar.ts';

/** CSS pixels of the canvas, and of the disc's radius in it. */
const SIZE = 248;
const RADIUS = 96;
const HINT = 'Click a surface, or press c for the centre of the view, to see the light that one of its texels sends toward all directions.';

export class HemispherePlot {
  readonly element = el('section', { class: 'hemisphere', 'aria-labelledby': 'hemisphere-title' });
  private readonly canvas = el('canvas', {
    tabindex: 0, role: 'application', 'aria-label': 'Hemisphere of the texel; arrow keys read directions, Escape closes', 'aria-describedby': 'hemisphere-summary',
  });
  private readonly hint = el('p', { class: 'hint', tabindex: -1 }, HINT);
  private readonly summary = el('p', { id: 'hemisphere-summary' });
  private readonly readout = el('p', { class: 'readout', 'aria-live': 'polite' });
  private readonly close = el('button', { type: 'button' }, 'Close');
  private readonly plot: HTMLElement;
  private sample: TexelSample | null = null;
  private cursor: Sector | null = null;

  constructor() {
    this.plot = el('div', { class: 'plot', hidden: true }, this.canvas, this.readout, this.summary, this.close);
    this.element.append(el('h3', { id: 'hemisphere-title' }, 'Hemisphere of a texel'), this.hint, this.plot);
    this.canvas.addEventListener('pointermove', (event) => this.point(event));
    this.canvas.addEventListener('pointerleave', () => this.moveCursor(null));
    this.canvas.addEventListener('keydown', (event) => this.onKey(event));
    this.close.addEventListener('click', () => this.show(null));
  }

  get open(): boolean {
    return this.sample !== null;
  }

  /** Shows a texel, or the hint where there is none. */
  show(sample: TexelSample | null): void {
    const focused = this.plot.contains(document.activeElement);
    this.sample = sample;
    this.plot.hidden = sample === null;
    this.hint.hidden = sample !== null;
    this.cursor = null;
    // What is hidden loses the focus, and a keyboard would begin again at the top of the page.
    if (!sample && focused) this.hint.focus();
    if (!sample) return;
    setText(this.summary, describe(sample));
    this.moveCursor(null);
  }

  /** For the reader of a keyboard: the plot, ready for arrow keys. */
  focus(): void {
    this.canvas.focus();
  }

  private point({ offsetX, offsetY }: PointerEvent): void {
    const scale = this.canvas.clientWidth / SIZE;
    const [x, y] = [(offsetX / scale - SIZE / 2) / RADIUS, (SIZE / 2 - offsetY / scale) / RADIUS];
    if (this.sample) this.moveCursor(sectorAt(x, y, this.sample.grid));
  }

  private onKey(event: KeyboardEvent): void {
    if (!this.sample) return;
    const { grid, view } = this.sample;
    const start = this.cursor ?? sectorAt(...toDisc(Math.min(view.theta, 89.9), view.phi), grid) ?? { i: 0, j: 0 };
    const next = neighbour(start, event.key, grid);
    if (!next) return;
    event.preventDefault();
    this.moveCursor(this.cursor ? next : start);
  }

  private moveCursor(sector: Sector | null): void {
    this.cursor = sector;
    setText(this.readout, sector && this.sample ? readSector(this.sample, sector) : 'Point at the plot, or use arrow keys in it, to read a direction.');
    this.draw();
  }

  private draw(): void {
    const { sample, canvas } = this;
    const ratio = Math.max(1, devicePixelRatio);
    canvas.width = canvas.height = SIZE * ratio;
    const ctx = canvas.getContext('2d');
    if (!ctx || !sample) return;
    const style = getComputedStyle(canvas);
    ctx.scale(ratio, ratio);
    ctx.translate(SIZE / 2, SIZE / 2);
    for (let i = 0; i < sample.grid.nTheta; i++) {
      for (let j = 0; j < sample.grid.nPhi; j++) drawSector(ctx, sample, { i, j });
    }
    if (this.cursor) {
      tracePath(ctx, sample, this.cursor);
      outline(ctx);
    }
    drawView(ctx, sample);
    ctx.fillStyle = style.color;
    ctx.font = `11px ${style.fontFamily}`;
    ctx.textAlign = 'center';
    ctx.fillText('φ 0°', RADIUS + 15, 4);
    ctx.fillText('φ 90°', 0, -RADIUS - 8);
    ctx.fillText('θ = 90° at the rim', 0, RADIUS + 18);
  }
}

function drawSector(ctx: CanvasRenderingContext2D, sample: TexelSample, sector: Sector): void {
  const at = sectorIndex(sector, sample.grid) * 3;
  const colour = `rgb(${sample.coded.subarray(at, at + 3).join(' ')})`;
  tracePath(ctx, sample, sector);
  ctx.fillStyle = colour;
  ctx.fill();
  // Closes the hairlines that smoothing leaves between neighbours.
  ctx.strokeStyle = colour;
  ctx.lineWidth = 1;
  ctx.stroke();
}

/** The canvas has y downward: angles are turned over. */
function tracePath(ctx: CanvasRenderingContext2D, sample: TexelSample, sector: Sector): void {
  const { inner, outer, from, to } = sectorBounds(sector, sample.grid);
  ctx.beginPath();
  ctx.arc(0, 0, outer * RADIUS, -to, -from);
  ctx.arc(0, 0, inner * RADIUS, -from, -to, true);
  ctx.closePath();
}

/** A cross where the camera was: dark on light on whatever lies below. */
function drawView(ctx: CanvasRenderingContext2D, { view }: TexelSample): void {
  const [x, y] = toDisc(view.theta, view.phi).map((v) => v * RADIUS);
  ctx.beginPath();
  ctx.arc(x, -y, 5, 0, 2 * Math.PI);
  outline(ctx);
}

function outline(ctx: CanvasRenderingContext2D): void {
  for (const [colour, width] of [['#000', 3.5], ['#fff', 1.5]] as const) {
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.stroke();
  }
}

function readSector(sample: TexelSample, sector: Sector): string {
  const { theta, phi } = sectorDirection(sector, sample.grid);
  const at = sectorIndex(sector, sample.grid) * 3;
  const light = [...sample.radiance.subarray(at, at + 3)].map(radiance).join(', ');
  return `θ ${theta.toFixed(1)}°, φ ${phi.toFixed(1)}°: sRGB ${sample.coded.subarray(at, at + 3).join(', ')}; radiance ${light} W/(sr m²)`;
}

/** What the plot shows, for those who do not see it. */
export function describe(sample: TexelSample): string {
  const { nTheta, nPhi } = sample.grid;
  const bright = (index: number) => sample.radiance[index * 3] * 0.2126 + sample.radiance[index * 3 + 1] * 0.7152 + sample.radiance[index * 3 + 2] * 0.0722;
  let [least, most, where] = [Infinity, -Infinity, 0];
  for (let d = 0; d < nTheta * nPhi; d++) {
    const value = bright(d);
    least = Math.min(least, value);
    if (value > most) [most, where] = [value, d];
  }
  const { theta, phi } = sectorDirection({ i: Math.floor(where / nPhi), j: where % nPhi }, sample.grid);
  const part = sample.part === sample.surface ? '' : `, part ${sample.part}`;
  const place = `Texel (${sample.x}, ${sample.y}) of ${sample.surface}${part}${sample.covered ? '' : ', in the gutter'}`;
  const range = `luminance from ${radiance(least)} to ${radiance(most)} W/(sr m²), brightest toward θ ${theta.toFixed(1)}°, φ ${phi.toFixed(1)}°`;
  const view = `the ring marks the view, θ ${sample.view.theta.toFixed(1)}°, φ ${sample.view.phi.toFixed(1)}°`;
  return `${place}: ${sample.keptSamples} of ${nTheta * nPhi} samples kept; ${range}; ${view}.`;
}
