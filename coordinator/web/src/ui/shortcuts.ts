/**
 * Keys of a page with a viewer. Those that move the camera are the viewer's own; these, too, work only while the view or the inspector has
 * the focus: who speaks to a computer would trigger single letters of a whole page with any word (WCAG 2.1.4). The help lists both.
 */

import { el } from './dom.ts';

/** What keys do; the panel implements it. */
export interface ShortcutActions {
  mode(index: 0 | 1 | 2): void;
  toggleGrid(): void;
  toggleEnvironment(): void;
  toggleStatistics(): void;
  inspectCentre(): void;
  /** Closes what is open; false where nothing was. */
  close(): boolean;
}

const KEYS: [string[], string][] = [
  [['←', '→', '↑', '↓'], 'turn around the scene, while the view has the focus'],
  [['Shift + arrows'], 'move the view sideways'],
  [['+', '−'], 'nearer and farther'],
  [['Home'], 'back to the first view'],
  [['1', '2', '3'], 'full light field, diffuse only, error against raw'],
  [['g'], 'texel grid'],
  [['e'], 'the environment behind the scene'],
  [['i'], 'statistics'],
  [['c'], 'inspect the texel at the centre of the view; so does Enter on the view'],
  [['Esc'], 'close the hemisphere'],
  [['?'], 'this help'],
];

/**
 * Where a key was pressed: in a field that wants letters and digits for itself, elsewhere in the view or the inspector, or anywhere else.
 */
export type Place = 'field' | 'inside' | 'outside';

/** Which of the keys an event means; null where it means none. Escape is no letter, and closes from anywhere. */
export function meantKey(event: Pick<KeyboardEvent, 'key' | 'ctrlKey' | 'metaKey' | 'altKey'>, place: Place): string | null {
  if (event.ctrlKey || event.metaKey || event.altKey) return null;
  return event.key === 'Escape' || place === 'inside' ? event.key : null;
}

/** Begins to listen to keys in `places`; returns what opens the help. */
export function installShortcuts(actions: ShortcutActions, places: readonly HTMLElement[]): () => void {
  const help = helpDialog();
  const openHelp = () => {
    if (!help.open) help.showModal();
  };
  const act: Record<string, () => void> = {
    '1': () => actions.mode(0),
    '2': () => actions.mode(1),
    '3': () => actions.mode(2),
    g: actions.toggleGrid,
    e: actions.toggleEnvironment,
    i: actions.toggleStatistics,
    c: actions.inspectCentre,
    '?': openHelp,
  };
  document.addEventListener('keydown', (event) => {
    if (event.defaultPrevented || document.querySelector('dialog[open]')) return;
    const inside = places.some((place) => place.contains(event.target as Node));
    const key = meantKey(event, takesText(event.target) ? 'field' : inside ? 'inside' : 'outside');
    if (key === 'Escape' && actions.close()) return event.preventDefault();
    const action = key !== null && Object.hasOwn(act, key) ? act[key] : undefined;
    if (!action) return;
    event.preventDefault();
    action();
  });
  return openHelp;
}

/** Whether an element wants letters and digits for itself. */
function takesText(target: EventTarget | null): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement) return !['radio', 'checkbox', 'range', 'button'].includes(target.type);
  return target instanceof HTMLTextAreaElement || target instanceof HTMLSelectElement || target.isContentEditable;
}

function helpDialog(): HTMLDialogElement {
  const rows = KEYS.map(([keys, what]) => el('div', {}, el('dt', {}, ...keys.flatMap((k, n) => [n > 0 ? ' ' : '', el('kbd', {}, k)])), el('dd', {}, what)));
  const where = el('p', {}, 'Keys work while the view or the inspector has the focus: click there, or go there with Tab.');
  const close = el('form', { method: 'dialog' }, el('button', { autofocus: true }, 'Close'));
  const dialog = el('dialog', { class: 'help', 'aria-labelledby': 'help-title' }, el('h2', { id: 'help-title' }, 'Keys'), where, el('dl', { class: 'keys' }, ...rows), close);
  document.body.append(dialog);
  return dialog;
}
