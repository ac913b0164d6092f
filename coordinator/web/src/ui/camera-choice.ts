/** The author's cameras, to choose the first view from. Not there where a scene has none. */

import type { KilnViewerElement } from '../viewer/api.ts';
import { el, setHidden } from './dom.ts';

/** What is shown where the view is nobody's choice but the reader's; it cannot be chosen. */
const MOVED = '\u0000moved';

export class CameraChoice {
  readonly element: HTMLLabelElement;
  private readonly select = el('select');
  private listed = '';

  constructor(private readonly viewer: KilnViewerElement) {
    this.element = el('label', { class: 'field', hidden: true }, el('span', {}, 'Camera'), this.select);
    this.select.addEventListener('change', () => this.choose());
    for (const event of ['model', 'load', 'camera-change']) viewer.addEventListener(event, () => this.sync());
    this.sync();
  }

  private choose(): void {
    const { value } = this.select;
    // Chosen again after the view was moved, the name is no news to the viewer.
    if (value === this.viewer.cameraName) this.viewer.resetCamera();
    else this.viewer.cameraName = value;
  }

  private sync(): void {
    const { model, cameraName, cameraMoved } = this.viewer;
    const cameras = model?.cameras ?? [];
    setHidden(this.element, cameras.length === 0);
    const list = JSON.stringify(cameras);
    if (list !== this.listed) {
      this.listed = list;
      const moved = el('option', { value: MOVED, disabled: true, hidden: true }, 'Where you moved it');
      this.select.replaceChildren(el('option', { value: '' }, 'First view'), ...cameras.map((name) => el('option', { value: name }, name)), moved);
    }
    this.select.value = cameraMoved ? MOVED : cameras.includes(cameraName) ? cameraName : '';
  }
}
