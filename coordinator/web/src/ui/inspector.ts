/**
 * The panel beside a viewer: how it draws, what it costs, and the hemisphere of the texel that was clicked. It knows the viewer by its
 * public face alone, so that any page can put the two together.
 */

import type { KilnViewerElement, TexelSample, ViewMode } from '../viewer/api.ts';
import { Announcer } from './announcer.ts';
import { CameraChoice } from './camera-choice.ts';
import { DisplayControls } from './display-controls.ts';
import { el } from './dom.ts';
import { linkToView, syncCameraWithHash } from './hash-sync.ts';
import { HemispherePlot } from './hemisphere.ts';
import { type ShortcutActions, installShortcuts } from './shortcuts.ts';
import { Statistics } from './statistics.ts';

const MODES: readonly ViewMode[] = ['light-field', 'diffuse', 'error'];

/** The panel for a viewer. `fileName` names screenshots, without their extension. Also keeps the camera in the page's address. */
export function inspectorPanel(viewer: KilnViewerElement, fileName: () => string): HTMLElement {
  const controls = new DisplayControls(viewer);
  controls.element.prepend(new CameraChoice(viewer).element);
  const statistics = new Statistics(viewer);
  const plot = new HemispherePlot();
  const said = new Announcer();
  const inspectCentre = () => {
    if (viewer.pickAt(viewer.clientWidth / 2, viewer.clientHeight / 2)) plot.focus();
    else said.say('There is no baked surface at the centre of the view.');
  };
  const keys: ShortcutActions = {
    mode: (index) => controls.setMode(MODES[index]),
    toggleGrid: () => controls.toggleGrid(),
    toggleEnvironment: () => controls.toggleEnvironment(),
    toggleStatistics: () => statistics.toggle(),
    inspectCentre,
    close: () => {
      const open = plot.open;
      if (open) plot.show(null);
      return open;
    },
  };
  const panel = el('section', { class: 'panel inspector', 'aria-labelledby': 'inspector-title' });
  const openHelp = installShortcuts(keys, [viewer, panel]);
  viewer.addEventListener('pick', (event) => plot.show((event as CustomEvent<TexelSample | null>).detail));
  syncCameraWithHash(viewer);
  const actions = el(
    'div',
    { class: 'row' },
    button('Reset the camera', () => viewer.resetCamera()),
    button('Copy link', async (self) => flash(self, (await copy(linkToView(viewer))) ? 'Copied' : 'Copy it from the address bar')),
    button('Screenshot', (self) => screenshot(viewer, fileName()).catch((error: Error) => flash(self, error.message))),
    button('Inspect the centre', inspectCentre),
    button('Keys', openHelp),
  );
  panel.append(el('h2', { id: 'inspector-title' }, 'Inspector'), controls.element, actions, plot.element, statistics.element, said.element);
  return panel;
}

function button(text: string, act: (self: HTMLButtonElement) => unknown): HTMLButtonElement {
  const self = el('button', { type: 'button' }, text);
  self.addEventListener('click', () => void act(self));
  return self;
}

/** Says on the button itself, for a moment, what came of it. */
function flash(self: HTMLButtonElement, text: string): void {
  const usual = self.dataset.usual ?? self.textContent ?? '';
  self.dataset.usual = usual;
  self.textContent = text;
  window.setTimeout(() => (self.textContent = usual), 2_000);
}

async function copy(text: string): Promise<boolean> {
  // Only in secure contexts is there a clipboard.
  return navigator.clipboard ? navigator.clipboard.writeText(text).then(() => true, () => false) : false;
}

async function screenshot(viewer: KilnViewerElement, name: string): Promise<void> {
  const url = URL.createObjectURL(await viewer.toBlob({ mimeType: 'image/png' }));
  el('a', { href: url, download: `${fileSafe(name)}.png` }).click();
  // The download has its own hold of the bytes once it has begun.
  window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** A name that every file system takes. */
export const fileSafe = (name: string): string => name.replace(/[^\p{L}\p{N}._-]+/gu, '-').replace(/^[-.]+|-+$/g, '').slice(0, 80) || 'kiln';
