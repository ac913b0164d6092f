/** How the light field is drawn: mode, texel grid, environment, exposure, and for those who compare, scheme and filter. */

import type { KilnViewerElement, ViewMode, ViewerModel } from '../viewer/api.ts';
import { el, setHidden, setText } from './dom.ts';

const MODES: [ViewMode, string][] = [
  ['light-field', 'Full light field'],
  ['diffuse', 'Diffuse only'],
  ['error', 'Error against raw'],
];
const SCHEMES: [KilnViewerElement['scheme'], string][] = [
  ['auto', 'Automatic'],
  ['raw', 'Raw'],
  ['expanded', 'Expanded'],
  ['streamed', 'Streamed'],
];
const FILTERS: [KilnViewerElement['filter'], string][] = [
  ['hardware', 'Hardware'],
  ['exact', 'Exact'],
];
/** Stops either way, and the slider's step. */
const EXPOSURE = { most: 6, step: 0.25 };

/** `+1.25 EV`. */
export const exposureText = (stops: number): string => `${stops > 0 ? '+' : stops < 0 ? '−' : ''}${Math.abs(stops).toFixed(2)} EV`;

/** Why `what`, which needs raw radiance, cannot be had; null where it can, or where nothing is known yet. */
export function rawReason(model: Pick<ViewerModel, 'hasRaw' | 'live'> | null, what: string): string | null {
  if (!model || model.hasRaw) return null;
  return model.live ? `${what} can be shown when the job is done, where it keeps raw radiance.` : `${what} needs raw radiance, which this package did not keep.`;
}

export class DisplayControls {
  readonly element = el('div', { class: 'controls' });
  private readonly modes = new Map<ViewMode, HTMLInputElement>();
  private readonly grid = el('input', { type: 'checkbox' });
  private readonly environment = el('input', { type: 'checkbox' });
  private readonly environmentRow = el('label', { class: 'check', hidden: true }, this.environment, 'Environment');
  private readonly scheme = select(SCHEMES);
  private readonly noError = el('p', { class: 'hint', id: 'error-mode-reason' });
  private readonly noRaw = el('p', { class: 'hint', id: 'raw-scheme-reason' });
  private readonly viewer: KilnViewerElement;

  constructor(viewer: KilnViewerElement) {
    this.viewer = viewer;
    const filter = select(FILTERS);
    this.element.append(
      this.modeGroup(),
      el('label', { class: 'check' }, this.grid, 'Texel grid'),
      this.environmentRow,
      this.exposureRow(),
      field('Scheme', this.scheme),
      this.noRaw,
      field('Filter', filter),
    );
    this.scheme.setAttribute('aria-describedby', this.noRaw.id);
    this.scheme.addEventListener('change', () => (viewer.scheme = this.scheme.value as KilnViewerElement['scheme']));
    filter.value = viewer.filter;
    filter.addEventListener('change', () => (viewer.filter = filter.value as KilnViewerElement['filter']));
    this.grid.checked = viewer.texelGrid;
    this.grid.addEventListener('change', () => (viewer.texelGrid = this.grid.checked));
    this.environment.checked = !viewer.hideEnvironment;
    this.environment.addEventListener('change', () => (viewer.hideEnvironment = !this.environment.checked));
    viewer.addEventListener('model', () => this.sync());
    // The viewer falls back to the full light field, or to a scheme of its choice, where what was asked for fails.
    viewer.addEventListener('error', () => queueMicrotask(() => this.sync()));
    this.sync();
  }

  /** Chooses a mode, where it can be drawn. */
  setMode(mode: ViewMode): void {
    const input = this.modes.get(mode);
    if (!input || input.disabled) return;
    input.checked = true;
    this.viewer.mode = mode;
  }

  toggleGrid(): void {
    this.grid.click();
  }

  /** Shows or hides the environment, where there is one. */
  toggleEnvironment(): void {
    if (!this.environmentRow.hidden) this.environment.click();
  }

  private modeGroup(): HTMLElement {
    const group = el('fieldset', {}, el('legend', {}, 'Show'));
    for (const [mode, label] of MODES) {
      const input = el('input', { type: 'radio', name: 'view-mode', value: mode });
      input.addEventListener('change', () => this.setMode(mode));
      this.modes.set(mode, input);
      group.append(el('label', { class: 'check' }, input, label));
    }
    this.modes.get('error')?.setAttribute('aria-describedby', this.noError.id);
    group.append(this.noError);
    return group;
  }

  private sync(): void {
    const { model, mode, scheme } = this.viewer;
    const raw = model?.hasRaw ?? false;
    setHidden(this.environmentRow, model?.environment == null);
    for (const [name, input] of this.modes) {
      input.checked = name === mode;
      if (name === 'error') input.disabled = !raw;
    }
    this.scheme.value = scheme;
    for (const option of this.scheme.options) option.disabled = option.value === 'raw' && !raw;
    for (const [place, what] of [[this.noError, 'The error'], [this.noRaw, 'Raw']] as const) {
      const reason = rawReason(model, what);
      place.hidden = reason === null;
      setText(place, reason ?? '');
    }
  }

  private exposureRow(): HTMLElement {
    const { most, step } = EXPOSURE;
    const slider = el('input', { type: 'range', min: -most, max: most, step, value: Math.log2(this.viewer.exposure), id: 'exposure' });
    const value = el('output', { for: 'exposure' });
    const reset = el('button', { type: 'button' }, 'Reset exposure');
    const apply = () => {
      const stops = Number(slider.value);
      this.viewer.exposure = 2 ** stops;
      setText(value, exposureText(stops));
      slider.setAttribute('aria-valuetext', exposureText(stops));
      reset.disabled = stops === 0;
    };
    slider.addEventListener('input', apply);
    reset.addEventListener('click', () => {
      slider.value = '0';
      apply();
      slider.focus();
    });
    apply();
    return el('div', { class: 'exposure' }, el('label', { for: 'exposure' }, 'Exposure'), slider, value, reset);
  }
}

const select = (options: [string, string][]): HTMLSelectElement => el('select', {}, ...options.map(([value, text]) => el('option', { value }, text)));

const field = (name: string, control: HTMLElement): HTMLElement => el('label', { class: 'field' }, el('span', {}, name), control);
