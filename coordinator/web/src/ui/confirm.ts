/** A question before something that cannot be undone. The browser's own confirm() would stop the page, its polling and its picture. */

import { el } from './dom.ts';

/** Asks; true where the person chose `action`. Escape, and the button that has the focus first, mean no. */
export function confirmAction(question: string, action: string): Promise<boolean> {
  const no = el('button', { value: 'no', autofocus: true }, 'Go back');
  const yes = el('button', { value: 'yes', class: 'danger' }, action);
  const text = el('p', { id: 'confirm-question' }, question);
  const form = el('form', { method: 'dialog' }, text, el('div', { class: 'row' }, no, yes));
  const dialog = el('dialog', { 'aria-labelledby': 'confirm-question' }, form);
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue === 'yes');
    });
  });
}
