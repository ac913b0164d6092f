/**
 * Keys of a page with a viewer. Those that move the camera are the viewer's own and work where it has the focus; these work anywhere but in
 * fields, where people type. The help lists both.
 */

import { el } from './dom.ts';

/** What keys do; the panel implements it. */
export interface ShortcutActions {
  mode(index: 0 | 1 | 2): void;
  toggleGrid(): void;
  toggleStatistics(): void;
  inspectCentre(): void;
  /** Closes what is open; false where nothing was. */
  close(): boolean;
}

const KEYS: [string[], string][] = [
  [['←', '→', '↑', '↓'], 'turn around the scene (with the focus on the view)'],
  [['Shift + arrows'], 'move the view sideways'],
  [['+', '−'], 'nearer and farther'],
  [['Home'], 'back to the first view'],
  [['1', '2', '3'], 'full light field, diffuse only, error against raw'],
  [['g'], 'texel grid'],
  [['i'], 'statistics'],
  [['c'], 'inspect the texel at the centre of the view; so does Enter on the view'],
  [['Esc'], 'close the hemisphere'],
  [['?'], 'this help'],
];

/** Begins to listen; returns what opens the help. */
export function installShortcuts(actions: ShortcutActions): () => void {
  const help = helpDialog();
  const openHelp = () => {
    if (!help.open) help.showModal();
  };
  const act: Record<string, () => void> = {
    '1': () => actions.mode(0),
    '2': () => actions.mode(1),
    '3': () => actions.mode(2),
    g: actions.toggleGrid,
    i: actions.toggleStatistics,
    c: actions.inspectCentre,
    '?': openHelp,
  };
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || document.querySelector('dialog[open]')) return;
    if (event.key === 'Escape' && actions.close()) return event.preventDefault();
    if (takesText(event.target)) return;
    const action = Object.hasOwn(act, event.key) ? act[event.key] : undefined;
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
  const close = el('form', { method: 'dialog' }, el('button', { autofocus: true }, 'Close'));
  const dialog = el('dialog', { class: 'help', 'aria-labelledby': 'help-title' }, el('h2', { id: 'help-title' }, 'Keys'), el('dl', { class: 'keys' }, ...rows), close);
  document.body.append(dialog);
  return dialog;
}
