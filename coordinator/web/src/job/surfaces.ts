/** The table of a job's surfaces: how far each is baked, how it is drawn, and what its encoding came to. */

import { type TileRuns, countWithin } from '../live/runs.ts';
import { el, setText } from '../ui/dom.ts';
import { bytes } from '../ui/format.ts';
import type { SurfaceModel, ViewerModel } from '../viewer/api.ts';

const COLUMNS = ['Surface', 'Texture', 'Tiles', 'Drawn as', 'Memory', 'Ratio', 'Average error', 'Largest error'];

/** The cells of a surface's row behind its name. Without the runs of a job (a package is complete), all tiles are done. */
export function surfaceCells(surface: SurfaceModel, baked: TileRuns | null): string[] {
  const { firstTile, tileCount } = surface;
  const done = baked ? countWithin(baked, firstTile, tileCount) : tileCount;
  // Errors are counted in steps of a coded byte.
  const error = (value: number | null, digits: number) => (value === null ? '–' : `${value.toFixed(digits)}/255`);
  return [
    `${surface.width} × ${surface.height}`,
    `${done} of ${tileCount}`,
    surface.scheme ?? 'not yet',
    bytes(surface.gpuBytes),
    surface.ratio === null ? '–' : `${surface.ratio.toFixed(1)} : 1`,
    error(surface.averageError, 2),
    error(surface.maxError, 0),
  ];
}

export class SurfaceTable {
  readonly element: HTMLElement;
  private readonly body = el('tbody');
  private readonly rows: HTMLTableRowElement[] = [];

  constructor() {
    const head = el('tr', {}, ...COLUMNS.map((name) => el('th', { scope: 'col' }, name)));
    const table = el('table', {}, el('caption', { class: 'visually-hidden' }, 'Surfaces of the scene'), el('thead', {}, head), this.body);
    const scroll = el('div', { class: 'scroll', tabindex: 0, role: 'region', 'aria-label': 'Table of surfaces' }, table);
    this.element = el('section', { 'aria-labelledby': 'surfaces-title', hidden: true }, el('h2', { id: 'surfaces-title' }, 'Surfaces'), scroll);
  }

  update(model: ViewerModel | null, baked: TileRuns | null): void {
    this.element.hidden = model === null;
    const surfaces = model?.surfaces ?? [];
    while (this.rows.length > surfaces.length) this.rows.pop()?.remove();
    surfaces.forEach((surface, n) => {
      const row = (this.rows[n] ??= this.body.appendChild(el('tr', {}, el('th', { scope: 'row' }), ...COLUMNS.slice(1).map(() => el('td')))));
      [surface.name, ...surfaceCells(surface, baked)].forEach((text, column) => setText(row.cells[column], text));
    });
  }
}
