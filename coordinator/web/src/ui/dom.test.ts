import { afterEach, expect, test, vi } from 'vitest';
import { setHidden } from './dom.ts';

/** As much of an element as can have the focus. */
const page = { activeElement: null as unknown };
const button = () => {
  const self = { hidden: false, focus: () => (page.activeElement = self), contains: (other: unknown) => other === self };
  return self as unknown as HTMLElement;
};
vi.stubGlobal('document', page);
afterEach(() => (page.activeElement = null));

test('what is hidden hands its focus to the first that is shown', () => {
  const [cancel, remove, title] = [button(), button(), button()];
  cancel.focus();
  remove.hidden = true;
  setHidden(cancel, true, remove, title);
  expect([cancel.hidden, page.activeElement === title]).toEqual([true, true]);
});

test('the focus stays where it is when something else is hidden, or the same is shown', () => {
  const [cancel, remove, title] = [button(), button(), button()];
  remove.focus();
  setHidden(cancel, true, remove, title);
  setHidden(remove, false, title);
  expect([cancel.hidden, remove.hidden, page.activeElement === remove]).toEqual([true, false, true]);
});
