/** The table of workers, and the farm's totals. */

import { serviceUrl } from '../live/http.ts';
import type { WorkerRecord } from '../live/records.ts';
import { Terms, el } from '../ui/dom.ts';
import { bytes, duration, rate, short } from '../ui/format.ts';

const COLUMNS = ['Name', 'Threads', 'Features', 'Bakes', 'Rays', 'Texels', 'Most memory', 'Last heard'];

export class WorkerTable {
  readonly element: HTMLElement;
  private readonly body = el('tbody');

  constructor() {
    const head = el('tr', {}, ...COLUMNS.map((name) => el('th', { scope: 'col' }, name)));
    const table = el('table', {}, el('caption', { class: 'visually-hidden' }, 'Workers that were heard lately'), el('thead', {}, head), this.body);
    this.element = el('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': 'Table of workers' }, table);
  }

  /** `at` is the coordinator's clock; `jobName` names a job that a worker bakes. */
  update(workers: WorkerRecord[], at: number, jobName: (id: string) => string): void {
    const focused = this.body.contains(document.activeElement) ? (document.activeElement as HTMLElement).dataset.worker : undefined;
    const none = el('tr', {}, el('td', { colspan: COLUMNS.length }, 'No worker is connected. Start one with ', el('code', {}, `kiln work --join ${serviceUrl('.')}`), '.'));
    this.body.replaceChildren(...(workers.length > 0 ? workers.map((worker) => row(worker, at, jobName)) : [none]));
    if (focused) this.body.querySelector<HTMLElement>(`[data-worker="${CSS.escape(focused)}"]`)?.focus();
  }
}

function row(worker: WorkerRecord, at: number, jobName: (id: string) => string): HTMLTableRowElement {
  const bakes = worker.job ? el('a', { href: serviceUrl(`jobs/${encodeURIComponent(worker.job)}`), 'data-worker': worker.id }, jobName(worker.job)) : 'nothing now';
  const seen = Math.max(0, at - worker.seen_ms) / 1000;
  const cells: (Node | string)[] = [
    String(worker.threads),
    worker.features.join(', ') || 'none',
    bakes,
    rate(worker.rays_per_second),
    rate(worker.texels_per_second),
    bytes(worker.peak_rss_bytes),
    seen < 5 ? 'just now' : `${duration(seen)} ago`,
  ];
  return el('tr', {}, el('th', { scope: 'row' }, worker.name), ...cells.map((cell) => el('td', {}, cell)));
}

/** The farm in a few figures. */
export class Totals {
  private readonly terms = new Terms();
  readonly element = this.terms.element;

  constructor() {
    this.element.classList.add('totals');
  }

  update(workers: WorkerRecord[]): void {
    for (const [name, text] of totals(workers)) this.terms.set(name, text);
  }
}

/** Rows of the totals; speeds only where the coordinator measures them. */
export function totals(workers: WorkerRecord[]): [string, string | null][] {
  const sum = (figure: (worker: WorkerRecord) => number) => workers.reduce((total, worker) => total + figure(worker), 0);
  const measured = workers.some((worker) => worker.rays_per_second !== undefined);
  return [
    ['Workers', `${workers.length} (${sum((w) => Number(w.job !== null))} baking)`],
    ['Threads', short(sum((w) => w.threads))],
    ['Rays now', measured ? rate(sum((w) => w.rays_per_second ?? 0)) : null],
    ['Texels now', measured ? rate(sum((w) => w.texels_per_second ?? 0)) : null],
    ['Rays traced', short(sum((w) => w.rays))],
    ['Texels baked', short(sum((w) => w.texels_done))],
    ['Processor time', duration(sum((w) => w.core_seconds))],
  ];
}
