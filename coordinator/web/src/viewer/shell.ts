/**
 * The inside of `<kiln-viewer>`: the canvas, and over it poster, progress bar and message. What is slotted goes when the built-in part
 * would.
 */

import { STYLE } from './style.ts';

export interface Shell {
  canvas: HTMLCanvasElement;
  poster: HTMLElement;
  bar: HTMLElement;
  /** What grows in the bar. */
  fill: HTMLElement;
  message: HTMLElement;
}

/** Fills a shadow root. */
export function makeShell(shadow: ShadowRoot): Shell {
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(STYLE);
  shadow.adoptedStyleSheets = [sheet];
  const make = (tag: string, name: string, parent: Node) => {
    const element = document.createElement(tag);
    element.className = name;
    parent.appendChild(element);
    return element;
  };
  const canvas = make('canvas', 'canvas', shadow) as HTMLCanvasElement;
  const poster = make('div', 'poster', shadow);
  make('slot', 'picture', poster).setAttribute('name', 'poster');
  const bar = make('div', 'progress', shadow);
  const barSlot = make('slot', '', bar);
  barSlot.setAttribute('name', 'progress-bar');
  const track = make('div', 'bar', barSlot);
  const message = make('div', 'message', shadow);
  message.setAttribute('role', 'alert');
  message.hidden = true;
  bar.hidden = true;
  return { canvas, poster, bar, fill: make('div', '', track), message };
}

/** Shows the picture of a URL, as the document resolves it, until the scene is there; null: none. */
export function showPoster({ poster }: Shell, url: string | null): void {
  const picture = poster.firstElementChild as HTMLElement;
  picture.style.backgroundImage = url ? `url(${JSON.stringify(new URL(url, document.baseURI).href)})` : '';
}

/** Shows the bar until all is there: `share` of 1. */
export function showProgress({ bar, fill }: Shell, share: number): void {
  bar.hidden = share >= 1;
  fill.style.transform = `scaleX(${share})`;
}

/** Shows what went wrong; empty: nothing has. */
export function showMessage({ message }: Shell, text: string): void {
  message.hidden = text === '';
  message.textContent = text;
}

const KEYS = 'Arrow keys turn, Shift and arrow keys move, plus and minus zoom, Home resets, Enter inspects the texel in the middle.';

/** Says what the canvas is. Who may not move the camera is not told how, and scrolls past. */
export function describe(canvas: HTMLCanvasElement, alt: string, movable: boolean): void {
  canvas.classList.toggle('still', !movable);
  if (movable) canvas.tabIndex = 0;
  else canvas.removeAttribute('tabindex');
  canvas.setAttribute('role', movable ? 'application' : 'img');
  const name = alt || 'Baked scene';
  canvas.setAttribute('aria-label', movable ? `${name}. ${KEYS}` : name);
}
