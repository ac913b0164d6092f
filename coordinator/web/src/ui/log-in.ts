/**
 * The form that stands above a page's content while the service asks for an access token, and the line that stands in its place
 * afterwards. A service without tokens never shows either.
 */

import { watchAccess } from '../live/http.ts';
import { logIn, logOut } from '../live/session.ts';
import { Notice } from './announcer.ts';
import { el, setHidden, setText } from './dom.ts';

/** Under this name the browser remembers who is logged in, for the line; the session itself no script can read. */
const KEY = 'kiln-session';

export class LogIn {
  readonly element = el('div', { class: 'log-in' });
  private readonly field = el('input', { type: 'password', name: 'token', autocomplete: 'current-password', required: true, spellcheck: 'false' }) as HTMLInputElement;
  private readonly button = el('button', { type: 'submit' }, 'Log in') as HTMLButtonElement;
  private readonly notice = new Notice();
  private readonly form = el(
    'form',
    { class: 'panel', 'aria-label': 'Log in', hidden: true },
    el('p', {}, 'This service asks for an access token. Whoever runs it makes one with “kiln token create”.'),
    el('label', { class: 'field' }, el('span', {}, 'Access token'), this.field),
    this.button,
    this.notice.element,
  );
  private readonly who = el('span');
  private readonly line = el('p', { class: 'hint', hidden: true });

  /** `entered` is called when there is more to see than before. */
  constructor(private readonly entered: () => void) {
    const out = el('button', { type: 'button' }, 'Log out');
    this.line.append(this.who, ' ', out);
    this.element.append(this.form, this.line);
    this.form.addEventListener('submit', (event) => {
      event.preventDefault();
      void this.enter();
    });
    out.addEventListener('click', () => void this.leave());
    watchAccess((locked) => this.show(locked));
    this.show(false);
  }

  private show(locked: boolean): void {
    const name = locked ? null : localStorage.getItem(KEY);
    if (locked) localStorage.removeItem(KEY);
    setHidden(this.form, !locked);
    setText(this.who, `Logged in as ${name ?? ''}.`);
    setHidden(this.line, name === null, this.field);
  }

  private async enter(): Promise<void> {
    this.notice.show(null);
    this.button.disabled = true;
    const answer = await logIn(this.field.value);
    this.button.disabled = false;
    if (answer.kind === 'ok') {
      this.field.value = '';
      localStorage.setItem(KEY, answer.value.name);
      this.show(false);
      this.entered();
    } else {
      const text = answer.kind === 'away' ? 'The coordinator does not answer; try again.' : `You were not logged in: ${answer.detail}.`;
      this.notice.show({ role: 'alert', text });
      this.field.focus();
    }
  }

  private async leave(): Promise<void> {
    const answer = await logOut();
    if (answer.kind !== 'ok') return;
    localStorage.removeItem(KEY);
    // What is shown was for someone who has left.
    location.reload();
  }
}
