/**
 * Places that screen readers hear. A sentence of a `Notice` is spoken when it changes, not each time it is found unchanged; an `Announcer`
 * speaks at most every few seconds, the latest of what came: progress that is told with every tile would drown everything else.
 */

import type { Message } from '../live/messages.ts';
import { el, setText } from './dom.ts';

const QUIET_MS = 5_000;

/** A sentence above the page's content, as a banner, or nothing. Both roles are there from the start, empty:
 * many readers do not speak a role that appears together with its text. */
export class Notice {
  readonly element = el('div', { class: 'notices' });
  private readonly alert = el('p', { class: 'notice notice-alert', role: 'alert' });
  private readonly status = el('p', { class: 'notice', role: 'status' });

  constructor() {
    this.element.append(this.alert, this.status);
  }

  show(message: Message | null): void {
    for (const [place, role] of [[this.alert, 'alert'], [this.status, 'status']] as const) {
      setText(place, message?.role === role ? message.text : '');
    }
  }
}

/** A polite live region that is not seen. */
export class Announcer {
  readonly element = el('p', { class: 'visually-hidden', 'aria-live': 'polite' });
  private timer: number | undefined;
  private next = '';

  say(text: string): void {
    this.next = text;
    this.timer ??= window.setTimeout(() => {
      this.timer = undefined;
      setText(this.element, this.next);
    }, QUIET_MS);
  }
}
