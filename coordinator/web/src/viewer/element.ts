/**
 * `<kiln-viewer src="…/manifest.json">`: a baked scene in a page. Attributes, methods and events follow model-viewer's conventions, so
 * that who knows one knows the other; `api.ts` has them all.
 *
 * The element translates between HTML and the {@link Stage}. Without WebGL 2 it stays an element that says so, fires `error`, and keeps its
 * poster.
 */

import { LightFieldLoader } from '../loader.ts';
import type { ErrorDetail, KilnViewerElement, OrbitPosition, Scheme, TexelSample, ViewMode, ViewerModel, ViewerStats } from './api.ts';
import { modelOf } from './model.ts';
import { fieldOfView, oneOf, parseOrbit, parseVector, positive } from './parse.ts';
import { type Shell, describe, makeShell, showMessage, showPoster, showProgress } from './shell.ts';
import { Stage } from './stage.ts';

const ATTRIBUTES = [
  'src', 'alt', 'poster', 'loading', 'camera-controls', 'camera-orbit', 'camera-target', 'field-of-view', 'camera-name', 'auto-rotate', 'exposure',
  'mode', 'scheme', 'filter', 'texel-grid', 'hide-environment', 'memory-budget',
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
  private readonly shell: Shell;
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
    this.shell = makeShell(shadow);
    this.canvas = this.shell.canvas;
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
    if (name === 'alt') this.allowControls();
    if (name === 'poster') showPoster(this.shell, value);
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
      'hide-environment': () => (stage.options.environment = !this.hideEnvironment),
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
  get hideEnvironment(): boolean { return this.hasAttribute('hide-environment'); }
  set hideEnvironment(on: boolean) { this.toggleAttribute('hide-environment', on); }
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
    this.shell.poster.hidden = true;
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
    showProgress(this.shell, share);
    this.dispatchEvent(new CustomEvent('progress', { detail: { totalProgress: share } }));
  }

  private fail(detail: ErrorDetail): void {
    showProgress(this.shell, 1);
    showMessage(this.shell, detail.message);
    this.dispatchEvent(new CustomEvent('error', { detail }));
  }

  private clearMessage(): void {
    showMessage(this.shell, '');
  }

  private released(x: number, y: number): void {
    const from = this.pressed;
    this.pressed = null;
    if (from && Math.hypot(x - from.x, y - from.y) <= CLICK) this.pickAt(x, y);
  }

  private fit(): void {
    this.stage?.resize(this.clientWidth, this.clientHeight, Math.min(devicePixelRatio, 2));
  }

  private allowControls(): void {
    const on = this.hasAttribute('camera-controls') && this.getAttribute('camera-controls') !== 'false';
    if (this.stage) this.stage.controls.enabled = on;
    describe(this.canvas, this.alt, on);
  }

  private readonly rotation = (): void => {
    if (!this.stage) return;
    this.stage.autoRotate = this.autoRotate && this.visible && !this.calm.matches;
    if (this.stage.autoRotate) this.stage.frames.request();
  };
}

if (!customElements.get('kiln-viewer')) customElements.define('kiln-viewer', KilnViewer);
