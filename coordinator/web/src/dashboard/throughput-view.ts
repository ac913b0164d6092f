/**
 * Throughput over time: a curve for rays and one for texels, each with its own scale, and the same as a table for who does not see curves.
 */

import type { Throughput } from '../live/records.ts';
import { el, setText, svg } from '../ui/dom.ts';
import { rate, short } from '../ui/format.ts';
import { type Figure, areaPath, ceiling, series, smooth, tableRows } from './throughput.ts';

const [WIDTH, HEIGHT] = [720, 96];

/** One curve. */
class Curve {
  readonly element: HTMLElement;
  private readonly path = svg('path', { class: 'curve', 'vector-effect': 'non-scaling-stroke' });
  private readonly top = el('span', { class: 'curve-top' });
  private readonly now = el('strong');
  private readonly image: SVGSVGElement;

  constructor(private readonly title: string, private readonly figure: Figure) {
    const lines = [0, 0.5, 1].map((y) => svg('line', { x1: 0, x2: WIDTH, y1: y * HEIGHT, y2: y * HEIGHT, class: 'curve-line', 'vector-effect': 'non-scaling-stroke' }));
    this.image = svg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', role: 'img' }, ...lines, this.path);
    const axis = el('div', { class: 'curve-axis', 'aria-hidden': 'true' }, el('span', {}, '60 min ago'), el('span', {}, '30 min'), el('span', {}, 'now'));
    this.element = el('figure', {}, el('figcaption', {}, `${title}: `, this.now, this.top), this.image, axis);
  }

  draw(throughput: Throughput, at: number): void {
    const values = smooth(series(throughput, this.figure, at), throughput.interval_ms);
    const top = ceiling(values);
    // The youngest bucket is still being filled.
    const now = values[values.length - 2];
    this.path.setAttribute('d', areaPath(values, top, WIDTH, HEIGHT));
    setText(this.now, rate(now));
    setText(this.top, `scale to ${rate(top)}`);
    this.image.setAttribute('aria-label', `${this.title} over the last hour: now ${rate(now)}, at most ${rate(Math.max(...values))}; the table below has the figures`);
  }
}

export class ThroughputView {
  readonly element = el('div', { class: 'throughput' });
  private readonly curves = [new Curve('Rays', 'rays'), new Curve('Texels', 'texels')];
  private readonly body = el('tbody');

  constructor() {
    const head = el('tr', {}, ...['Time', 'Rays', 'Texels', 'Tiles', 'Workers'].map((name) => el('th', { scope: 'col' }, name)));
    const table = el('table', {}, el('caption', {}, 'Work in steps of five minutes, youngest first'), el('thead', {}, head), this.body);
    const details = el('details', {}, el('summary', {}, 'The same as a table'), el('div', { class: 'scroll' }, table));
    this.element.append(el('div', { class: 'curves' }, ...this.curves.map((c) => c.element)), details);
  }

  /** `at` is the coordinator's clock. */
  update(throughput: Throughput, at: number): void {
    for (const curve of this.curves) curve.draw(throughput, at);
    const rows = tableRows(throughput, at).map((row) => {
      const cells = [rate(row.raysPerSecond), rate(row.texelsPerSecond), short(row.tiles), String(row.workers)];
      return el('tr', {}, el('th', { scope: 'row' }, row.time), ...cells.map((text) => el('td', {}, text)));
    });
    const none = el('tr', {}, el('td', { colspan: 5 }, 'Nothing was baked in the last hour.'));
    this.body.replaceChildren(...(rows.length > 0 ? rows : [none]));
  }
}
