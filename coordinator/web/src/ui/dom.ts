/**
 * The few things that the pages ask of the DOM. A framework would be larger than all pages together, and what they draw changes by a text
 * or an attribute at a time. Text is always set as text: nothing that comes from outside is ever parsed as HTML.
 */

type Attributes = Record<string, string | number | boolean | null>;

/** An element with attributes (`false` and `null` leave one out, `true` sets it bare) and children. */
export function el<K extends keyof HTMLElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: (Node | string)[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  setAttributes(element, attributes);
  element.append(...children);
  return element;
}

/** The same for SVG. */
export function svg<K extends keyof SVGElementTagNameMap>(tag: K, attributes: Attributes = {}, ...children: (Node | string)[]): SVGElementTagNameMap[K] {
  const element = document.createElementNS('http://www.w3.org/2000/svg', tag);
  setAttributes(element, attributes);
  element.append(...children);
  return element;
}

function setAttributes(element: Element, attributes: Attributes): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== null && value !== false) element.setAttribute(name, value === true ? '' : String(value));
  }
}

/** Writes a text where it differs: a text node that is replaced loses its selection, and is read again where it is live. */
export function setText(node: Node, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

/**
 * Hides what has no use now, or shows it again. Where it has the focus, the first of `heirs` that is shown gets it: what is hidden loses
 * the focus, and a keyboard would begin again at the top of the page.
 */
export function setHidden(element: HTMLElement, hidden: boolean, ...heirs: HTMLElement[]): void {
  const focused = hidden && element.contains(document.activeElement);
  element.hidden = hidden;
  if (focused) heirs.find((heir) => !heir.hidden)?.focus();
}

/** An element of the page's own HTML. */
export function byId(id: string): HTMLElement {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page has no element #${id}`);
  return element;
}

/** A list of terms whose descriptions are updated by name; those without a text are hidden. */
export class Terms {
  readonly element = el('dl', { class: 'terms' });
  private readonly rows = new Map<string, { row: HTMLElement; value: HTMLElement }>();

  set(name: string, text: string | null): void {
    let entry = this.rows.get(name);
    if (!entry) {
      const value = el('dd');
      entry = { row: el('div', {}, el('dt', {}, name), value), value };
      this.rows.set(name, entry);
      this.element.append(entry.row);
    }
    entry.row.hidden = text === null;
    setText(entry.value, text ?? '');
  }
}

/**
 * Makes the skip link work: a bare `#main` would be resolved against <base>, and would replace the camera in the address.
 */
export function installSkipLink(): void {
  const link = document.querySelector<HTMLAnchorElement>('.skip-link');
  link?.addEventListener('click', (event) => {
    event.preventDefault();
    byId('main').focus();
  });
}
