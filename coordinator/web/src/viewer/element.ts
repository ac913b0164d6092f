/**
 * `<kiln-viewer src="…/manifest.json">`: a baked scene in a page. Attributes, methods and events follow model-viewer's conventions, so that who knows one
 * knows the other; `api.ts` has them all.
 *
 * The element translates between HTML and the {@link Stage}. Without WebGL 2 it stays an element that says so, fires `error`, and keeps its poster.
 */

import { LightFieldLoader } from '../loader.ts';
import type { ErrorDetail, KilnViewerElement, OrbitPosition, Scheme, TexelSample, ViewMode, ViewerModel, ViewerStats } from './api.ts';
import { modelOf } from './model.ts';
import { parseOrbit, parseVector, fieldOfView } from './parse.ts';
import { Stage } from './stage.ts';
import { STYLE } from './style.ts';

const ATTRIBUTES = [
  'src', 'alt', 'poster', 'loading', 'camera-controls', 'camera-orbit', 'camera-target', 'field-of-view', 'camera-name', 'auto-rotate', 'exposure',
  'mode', 'scheme', 'filter', 'texel-grid', 'memory-budget',
];
const MODES: ViewMode[] = ['light-field', 'diffuse', 'error'];
const SCHEMES = ['auto', 'raw', 'expanded', 'streamed'] as const;
const BUDGET_MIB = 512;
/** Pixels that a pointer may travel and still be a click. */
const CLICK = 4;
const NO_STATS: ViewerStats = {
  fps: 0, frameMs: 0, drawCalls: 0, triangles: 0, textureBytes: 0, budgetBytes: 0, firstPictureMs: null, codec: '', schemes: {}, busy: false,
};

export class KilnViewer extends HTMLElement implements KilnViewerElement {
  static readonly observedAttributes = ATTRIBUTES;
  private stage: Stage | null = null;
  private loader: LightFieldLoader | null = null;
  private complete = false;
  private visible = false;
  private wasVisible = false;
  private readonly canvas: HTMLCanvasElement;
  private readonly parts: { poster: HTMLElement; bar: HTMLElement; fill: HTMLElement; message: HTMLElement };
  private readonly resizer = new ResizeObserver(() => this.fit());
  private readonly watcher = new IntersectionObserver((entries) => this.seen(entries.some((entry) => entry.isIntersecting)));
  private readonly calm = matchMedia('(prefers-reduced-motion: reduce)');
  private pressed: { x: number; y: number } | null = null;
  private givingUp = false;
  /** Counts what was asked to be shown: only the last is. */
  private asked = 0;

  constructor() {
    super();
    const shadow = this.attachShadow({ mode: 'open' });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(STYLE);
    shadow.adoptedStyleSheets = [sheet];
    const make = (tag: string, name: string, parent: ParentNode & Node) => {
      const element = document.createElement(tag);
      element.className = name;
      parent.appendChild(element);
      return element;
    };
    this.canvas = make('canvas', 'canvas', shadow) as HTMLCanvasElement;
    // What is slotted goes when the built-in part would.
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
    this.parts = { poster, bar, fill: make('div', '', track), message };
    this.allowControls();
    this.canvas.addEventListener('pointerdown', ({ offsetX, offsetY, button }) => (this.pressed = button === 0 ? { x: offsetX, y: offsetY } : null));
    this.canvas.addEventListener('pointerup', ({ offsetX, offsetY }) => this.released(offsetX, offsetY));
    this.canvas.addEventListener('keydown', ({ key }) => {
      if (key === 'Enter') this.pickAt(this.clientWidth / 2, this.clientHeight / 2);
    });
  }

  connectedCallback(): void {
    if (this.stage) return;
    try {
      this.stage = new Stage(this.canvas, {
        error: (detail) => this.fail(detail),
        cameraChange: () => this.dispatchEvent(new CustomEvent('camera-change')),
        frame: () => this.dispatchEvent(new CustomEvent('stats', { detail: this.stats })),
        restored: () => this.clearMessage(),
        model: () => this.dispatchEvent(new CustomEvent('model', { detail: this.model })),
      });
    } catch (error) {
      this.canvas.hidden = true;
      this.fail({
        type: 'webgl',
        message:
          'This browser gives the page no WebGL 2, which the view needs; another browser, or its graphics acceleration, may help. ' +
          `(${(error as Error).message})`,
      });
      return;
    }
    for (const name of ATTRIBUTES) this.attributeChangedCallback(name, null, this.getAttribute(name));
    this.resizer.observe(this);
    this.watcher.observe(this);
    this.calm.addEventListener('change', this.rotation);
    this.fit();
  }

  disconnectedCallback(): void {
    this.loader?.abort();
    this.resizer.disconnect();
    this.watcher.disconnect();
    this.calm.removeEventListener('change', this.rotation);
    this.stage?.dispose();
    this.stage = null;
  }

  attributeChangedCallback(name: string, before: string | null, value: string | null): void {
    const { stage } = this;
    if (name === 'alt') this.label();
    if (name === 'poster') {
      const url = value && JSON.stringify(new URL(value, document.baseURI).href);
      (this.parts.poster.firstElementChild as HTMLElement).style.backgroundImage = url ? `url(${url})` : '';
    }
    if (!stage || before === value) return;
    const apply: Record<string, () => void> = {
      src: () => this.start(),
      'camera-controls': () => this.allowControls(),
      'camera-orbit': () => stage.aim({ orbit: (value && parseOrbit(value)) || undefined }),
      'camera-target': () => stage.aim({ target: (value && parseVector(value)) || undefined }),
      'field-of-view': () => stage.aim({ fieldOfView: value ? fieldOfView(value) : undefined }),
      'camera-name': () => stage.aim({ name: value ?? undefined }),
      'auto-rotate': this.rotation,
      exposure: () => (stage.options.exposure = this.exposure),
      mode: () => this.changeMode(),
      scheme: () => this.relay(),
      'memory-budget': () => this.relay(),
      filter: () => (stage.options.hardware = this.filter === 'hardware'),
      'texel-grid': () => (stage.options.texelGrid = this.texelGrid),
    };
    apply[name]?.();
    stage.frames.request();
  }

  get src(): string { return this.getAttribute('src') ?? ''; }
  set src(url: string) { this.setAttribute('src', url); }
  get alt(): string { return this.getAttribute('alt') ?? ''; }
  set alt(text: string) { this.setAttribute('alt', text); }
  get mode(): ViewMode { return oneOf(MODES, this.getAttribute('mode'), 'light-field'); }
  set mode(mode: ViewMode) { this.setAttribute('mode', mode); }
  get scheme(): 'auto' | Exclude<Scheme, 'mean'> { return oneOf(SCHEMES, this.getAttribute('scheme'), 'auto'); }
  set scheme(scheme: 'auto' | Exclude<Scheme, 'mean'>) { this.setAttribute('scheme', scheme); }
  get filter(): 'hardware' | 'exact' { return this.getAttribute('filter') === 'exact' ? 'exact' : 'hardware'; }
  set filter(filter: 'hardware' | 'exact') { this.setAttribute('filter', filter); }
  get texelGrid(): boolean { return this.hasAttribute('texel-grid'); }
  set texelGrid(on: boolean) { this.toggleAttribute('texel-grid', on); }
  get exposure(): number { return positive(this.getAttribute('exposure'), 1); }
  set exposure(factor: number) { this.setAttribute('exposure', String(factor)); }
  get memoryBudget(): number { return positive(this.getAttribute('memory-budget'), BUDGET_MIB); }
  set memoryBudget(mib: number) { this.setAttribute('memory-budget', String(mib)); }
  get autoRotate(): boolean { return this.hasAttribute('auto-rotate'); }
  set autoRotate(on: boolean) { this.toggleAttribute('auto-rotate', on); }
  get cameraName(): string { return this.getAttribute('camera-name') ?? ''; }
  set cameraName(name: string) { this.setAttribute('camera-name', name); }
  get cameraMoved(): boolean { return this.stage?.moved ?? false; }
  get loaded(): boolean { return this.complete; }
  get model(): ViewerModel | null { return this.stage?.object ? modelOf(this.stage.object) : null; }
  get stats(): ViewerStats { return this.stage?.stats() ?? NO_STATS; }

  showLive(sceneKiln: ArrayBuffer): void {
    this.loader?.abort();
    this.clearMessage();
    const asked = ++this.asked;
    this.complete = false;
    const { stage } = this;
    if (!stage) return;
    new Promise<void>((resolve) => resolve(stage.showLive(sceneKiln))).then(
      () => asked === this.asked && this.drawn(),
      (error: Error) => asked === this.asked && this.fail({ type: 'loadfailure', message: error.message }),
    );
  }

  addSegments(body: ArrayBuffer): number[] {
    return this.stage?.addSegments(body) ?? [];
  }

  getCameraOrbit(): OrbitPosition { return this.stage?.controls.position ?? { theta: 0, phi: 90, radius: 1 }; }
  getCameraTarget(): [number, number, number] { return this.getCamera().target; }
  getFieldOfView(): number { return this.getCamera().fieldOfView; }
  getCamera(): { eye: [number, number, number]; target: [number, number, number]; fieldOfView: number } {
    return this.stage?.getCamera() ?? { eye: [0, 0, 1], target: [0, 0, 0], fieldOfView: 45 };
  }
  setCamera(eye: [number, number, number], target: [number, number, number], fieldOfView = this.getFieldOfView()): void {
    this.stage?.setCamera({ eye, target, fieldOfView });
  }
  resetCamera(): void { this.stage?.home(); }
  /** Nothing is damped, so that the camera is always at its goal; the frame is drawn at once. */
  jumpCameraToGoal(): void { this.stage?.drawNow(); }

  toDataURL(type?: string, quality?: number): string {
    this.stage?.drawNow();
    return this.canvas.toDataURL(type, quality);
  }

  toBlob({ mimeType = 'image/png', qualityArgument }: { mimeType?: string; qualityArgument?: number } = {}): Promise<Blob> {
    this.stage?.drawNow();
    return new Promise((resolve, reject) => {
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error(`the browser cannot write ${mimeType}`))), mimeType, qualityArgument);
    });
  }

  pickAt(x: number, y: number): TexelSample | null {
    const sample = this.stage?.pickAt(x, y) ?? null;
    this.dispatchEvent(new CustomEvent('pick', { detail: sample }));
    return sample;
  }

  renderFloats(what: 'radiance' | 'lookup', width: number, height: number): Float32Array {
    return this.stage?.read(what, width, height) ?? new Float32Array(width * height * 4);
  }

  benchmark(frames: number): number[] { return this.stage?.frames.benchmark(frames) ?? []; }

  /** A mode that cannot be drawn is given up, and its reason told. */
  private changeMode(): void {
    const { stage } = this;
    if (!stage) return;
    const givenUp = this.givingUp;
    stage.options.mode = this.mode;
    stage.ensureMode().then(
      () => givenUp || this.clearMessage(),
      (error: Error) => {
        this.givingUp = true;
        this.mode = 'light-field';
        this.givingUp = false;
        this.fail({ type: 'loadfailure', message: error.message });
      },
    );
  }

  /** `loading="lazy"` waits until the element is nearly seen. */
  private seen(visible: boolean): void {
    const first = visible && !this.wasVisible;
    this.visible = visible;
    this.wasVisible ||= visible;
    this.rotation();
    if (first && this.getAttribute('loading') === 'lazy' && this.src) this.start();
  }

  private start(): void {
    const { stage, src } = this;
    if (!stage || !src || (this.getAttribute('loading') === 'lazy' && !this.wasVisible)) return;
    this.loader?.abort();
    const loader = new LightFieldLoader();
    this.loader = loader;
    const asked = ++this.asked;
    this.complete = false;
    this.clearMessage();
    const began = performance.now();
    // The last tenth is for what comes after the files.
    const progress = (share: number) => asked === this.asked && this.progress(share);
    progress(0);
    loader
      .loadAsync(src, ({ loaded, total }) => progress((0.9 * loaded) / Math.max(1, total)))
      .then((field) => (asked === this.asked ? stage.show(field, began) : undefined))
      .then(() => asked === this.asked && this.drawn())
      .catch((error: Error) => {
        if (asked === this.asked && error.name !== 'AbortError') this.fail({ type: 'loadfailure', message: error.message });
      });
  }

  private drawn(): void {
    if (!this.stage) return;
    this.stage.drawNow();
    this.parts.poster.hidden = true;
    this.parts.bar.hidden = true;
    this.progress(1);
    this.complete = true;
    this.dispatchEvent(new CustomEvent('load', { detail: { url: this.src } }));
  }

  private relay(): void {
    const { stage } = this;
    if (!stage) return;
    stage.options.scheme = this.scheme;
    stage.options.budget = this.memoryBudget * 2 ** 20;
    // Its errors have been told.
    stage.prepare().then(() => this.clearMessage(), () => {});
  }

  private progress(share: number): void {
    this.parts.bar.hidden = share >= 1;
    this.parts.fill.style.transform = `scaleX(${share})`;
    this.dispatchEvent(new CustomEvent('progress', { detail: { totalProgress: share } }));
  }

  private fail(detail: ErrorDetail): void {
    this.parts.bar.hidden = true;
    this.parts.message.hidden = false;
    this.parts.message.textContent = detail.message;
    this.dispatchEvent(new CustomEvent('error', { detail }));
  }

  private clearMessage(): void {
    this.parts.message.hidden = true;
    this.parts.message.textContent = '';
  }

  private released(x: number, y: number): void {
    const from = this.pressed;
    this.pressed = null;
    if (from && Math.hypot(x - from.x, y - from.y) <= CLICK) this.pickAt(x, y);
  }

  private fit(): void {
    this.stage?.resize(this.clientWidth, this.clientHeight, Math.min(devicePixelRatio, 2));
  }

  /** Who may not move the camera is not told how, and scrolls past. */
  private allowControls(): void {
    const on = this.hasAttribute('camera-controls') && this.getAttribute('camera-controls') !== 'false';
    if (this.stage) this.stage.controls.enabled = on;
    this.canvas.classList.toggle('still', !on);
    if (on) this.canvas.tabIndex = 0;
    else this.canvas.removeAttribute('tabindex');
    this.canvas.setAttribute('role', on ? 'application' : 'img');
    this.label();
  }

  private label(): void {
    const keys = 'Arrow keys turn, Shift and arrow keys move, plus and minus zoom, Home resets, Enter inspects the texel in the middle.';
    const name = this.alt || 'Baked scene';
    this.canvas.setAttribute('aria-label', this.canvas.classList.contains('still') ? name : `${name}. ${keys}`);
  }

  private readonly rotation = (): void => {
    if (!this.stage) return;
    this.stage.autoRotate = this.autoRotate && this.visible && !this.calm.matches;
    if (this.stage.autoRotate) this.stage.frames.request();
  };
}

function oneOf<T extends string>(known: readonly T[], value: string | null, otherwise: T): T {
  return known.find((item) => item === value) ?? otherwise;
}

function positive(text: string | null, otherwise: number): number {
  const value = Number(text);
  return text !== null && Number.isFinite(value) && value > 0 ? value : otherwise;
}

if (!customElements.get('kiln-viewer')) customElements.define('kiln-viewer', KilnViewer);
