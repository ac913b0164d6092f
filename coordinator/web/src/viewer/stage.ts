/**
 * What `<kiln-viewer>` shows: a renderer on a canvas, one light field at a time, a camera, and what it takes to get a frame of them. The element around it
 * knows attributes and events, this knows three.js.
 *
 * Every wait ends in a look whether its result is still wanted: pages change their mind while megabytes are on their way.
 */

import { Scene, PerspectiveCamera, Vector2, Vector3, WebGLRenderer } from 'three';
import { type Camera, DEFAULT_FIELD_OF_VIEW, defaultCamera } from '../field/camera.ts';
import { length, sub } from '../field/frame.ts';
import { type LightField, makeLiveField } from '../field/light-field.ts';
import { parseContainer } from '../format/container.ts';
import { parseSegments } from '../format/segment.ts';
import { LightFieldObject } from '../gl/object.ts';
import { Painter } from '../gl/painter.ts';
import type { ErrorDetail, OrbitPosition, Scheme, TexelSample, ViewMode, ViewerStats } from './api.ts';
import { cameraNames, viewOf } from './cameras.ts';
import { ViewControls } from './controls.ts';
import { Frames } from './frames.ts';
import { pick } from './pick.ts';

export interface StageEvents {
  error(detail: ErrorDetail): void;
  cameraChange(): void;
  /** A frame is finished. */
  frame(): void;
  /** The field, or how it is drawn, has changed. */
  model(): void;
  /** A context that was lost is there again, with everything in it. */
  restored(): void;
}

/** What is asked of the first view; what is left out is chosen. */
export interface CameraGoals {
  orbit?: OrbitPosition;
  target?: [number, number, number];
  /** Vertical, degrees. */
  fieldOfView?: number;
  /** One of the author's cameras. */
  name?: string;
}

/** How things are drawn; the element's attributes. */
export interface StageOptions {
  mode: ViewMode;
  scheme: 'auto' | Exclude<Scheme, 'mean'>;
  hardware: boolean;
  exposure: number;
  texelGrid: boolean;
  /** Bytes. */
  budget: number;
}

export class Stage {
  readonly controls: ViewControls;
  readonly frames: Frames;
  readonly options: StageOptions = { mode: 'light-field', scheme: 'auto', hardware: true, exposure: 1, texelGrid: false, budget: 512 << 20 };
  object: LightFieldObject | null = null;
  private goals: CameraGoals = {};
  private readonly listening = new AbortController();
  /** Milliseconds; null until the first complete picture. */
  firstPictureMs: number | null = null;
  autoRotate = false;
  private readonly renderer: WebGLRenderer;
  private readonly painter: Painter;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(DEFAULT_FIELD_OF_VIEW, 1, 0.01, 100);
  private readonly canvas: HTMLCanvasElement;
  private readonly events: StageEvents;
  /** The field that was asked for last; it is `object` once it is shown. */
  private latest: LightFieldObject | null = null;
  private rotatedAt = 0;
  /** Whether somebody chose the camera: it stays then, whatever is shown and however the element is resized. */
  private placed = false;
  private working = 0;

  /** Throws where the browser has no WebGL 2. */
  constructor(canvas: HTMLCanvasElement, events: StageEvents) {
    this.canvas = canvas;
    this.events = events;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: false, preserveDrawingBuffer: true });
    this.renderer.info.autoReset = false;
    this.renderer.debug.onShaderError = (gl, program, vertex, fragment) => {
      const logs = [gl.getProgramInfoLog(program), gl.getShaderInfoLog(vertex), gl.getShaderInfoLog(fragment)].filter(Boolean).join(' ');
      events.error({ type: 'shader', message: `This GPU's driver does not compile a shader of the viewer: ${logs}` });
    };
    this.painter = new Painter(this.renderer);
    this.controls = new ViewControls(this.camera, canvas, () => this.cameraMoved(), () => (this.placed = true));
    this.controls.onHome = () => this.home();
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    this.frames = new Frames(gl, (now) => this.draw(now), () => events.frame());
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      this.frames.stop();
      events.error({ type: 'context-lost', message: 'The GPU was taken away from this page; the picture comes back when it is given back.' });
    }, { signal: this.listening.signal });
    canvas.addEventListener('webglcontextrestored', () => {
      this.painter.settle();
      // Errors of it have been told.
      void this.prepare().then(events.restored, () => {});
    }, { signal: this.listening.signal });
  }

  /**
   * Shows a field; resolves when its first complete picture can be drawn, at once where another has replaced it meanwhile. What is shown now stays
   * until then, if the budget has room for both: a job that has just been baked does not fall back to its draft.
   */
  async show(field: LightField, began = performance.now()): Promise<void> {
    const object = new LightFieldObject(field, this.renderer);
    this.latest = object;
    const apart = this.object !== null && this.object.bytes + object.plannedBytes(this.options) <= this.options.budget;
    if (!apart) this.replace(object);
    this.firstPictureMs = null;
    try {
      await this.prepare(object);
    } catch (error) {
      if (apart) object.dispose();
      if (this.latest === object) this.latest = this.object;
      throw error;
    }
    if (this.latest !== object) {
      if (apart) object.dispose();
      return;
    }
    if (apart) this.replace(object);
    this.firstPictureMs = performance.now() - began;
  }

  /** A job while it bakes. */
  showLive(bytes: ArrayBuffer): Promise<void> {
    return this.show(makeLiveField(parseContainer(new Uint8Array(bytes))));
  }

  /** Adds tiles to a live field; their numbers. */
  addSegments(body: ArrayBuffer): number[] {
    const { object } = this;
    if (!object || object.field.manifest) throw new Error('no job is shown while it bakes: call showLive first');
    const tiles = parseSegments(new Uint8Array(body));
    void object.addTiles(tiles, () => this.frames.request()).catch((error: Error) => this.failed(object, error));
    return tiles.map(({ tile }) => tile);
  }

  /** Lays a field out: when it is new, and again after a change of scheme or budget, or a lost context. */
  prepare(object = this.object): Promise<void> {
    return this.during(async () => {
      try {
        const filling = object?.prepare({ ...this.options, changed: () => this.frames.request() });
        if (object) this.changed(object);
        await filling;
        await this.ensureMode(object);
      } catch (error) {
        if (object) this.failed(object, error as Error);
        throw error;
      }
    });
  }

  /** Makes what the mode draws available, and lets go of what only another mode draws. */
  ensureMode(object = this.object): Promise<void> {
    return this.during(async () => {
      const { mode, budget } = this.options;
      const wanted = () => this.options.mode === mode;
      if (mode !== 'error') object?.releaseRaw();
      if (mode === 'diffuse') await object?.ensure('mean', budget, wanted);
      if (mode === 'error') await object?.ensure('raw', budget, wanted);
      if (object) this.changed(object);
    });
  }

  /** Says what the first view should be, and shows it. */
  aim(goals: CameraGoals): void {
    this.goals = { ...this.goals, ...goals };
    this.home();
  }

  /** The first view: what was asked of it, and for the rest the author's camera of that name, or what `field/camera.ts` chooses. */
  home(): void {
    if (!this.object) return;
    const { orbit, target, fieldOfView } = this.goals;
    const chosen = this.firstCamera(this.object.field, fieldOfView);
    const centre = target ?? chosen.target;
    const offset = sub(chosen.eye, chosen.target);
    this.placed = false;
    this.put({ ...chosen, eye: [centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2]], target: centre });
    if (orbit) this.controls.position = orbit;
  }

  private firstCamera({ container, bounds }: LightField, fieldOfView?: number): Camera {
    const { cameras } = container.scene;
    const named = cameras[cameraNames(cameras).indexOf(this.goals.name ?? '')];
    if (!named) return defaultCamera(container, this.camera.aspect, fieldOfView);
    const view = viewOf(named, bounds, this.camera.aspect);
    return { ...view, fieldOfView: fieldOfView ?? view.fieldOfView };
  }

  /** Whether somebody chose the camera: a page, or a person who moved it. */
  get moved(): boolean {
    return this.placed;
  }

  setCamera(camera: Camera): void {
    this.placed = true;
    this.put(camera);
  }

  private put({ eye, target, fieldOfView }: Camera): void {
    this.camera.fov = fieldOfView;
    this.camera.updateProjectionMatrix();
    this.controls.place(new Vector3(...eye), new Vector3(...target), this.sceneRadius());
  }

  getCamera(): Camera {
    return { eye: this.camera.position.toArray(), target: this.controls.target.toArray(), fieldOfView: this.camera.fov };
  }

  /** Fits the drawing to the element: CSS pixels and device pixels per CSS pixel. */
  resize(width: number, height: number, ratio: number): void {
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!this.placed) this.home();
    this.frames.request();
  }

  /** The texel under a point of the canvas, CSS pixels. */
  pickAt(x: number, y: number): TexelSample | null {
    if (!this.object) return null;
    const { clientWidth, clientHeight } = this.canvas;
    return pick(this.object, this.camera, new Vector2((x / clientWidth) * 2 - 1, 1 - (y / clientHeight) * 2));
  }

  /** See {@link Painter.read}. */
  read(what: 'radiance' | 'lookup', width: number, height: number): Float32Array {
    if (!this.object) return new Float32Array(width * height * 4);
    const { aspect } = this.camera;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.fitClipPlanes();
    const out = this.painter.read(this.scene, this.camera, this.object, what, this.options, width, height);
    this.camera.aspect = aspect;
    this.camera.updateProjectionMatrix();
    return out;
  }

  /** Draws now: what is read from the canvas next is this. */
  drawNow(): void {
    this.draw(performance.now());
  }

  stats(): ViewerStats {
    const { render } = this.renderer.info;
    const schemes: Partial<Record<Scheme, number>> = {};
    for (const { scheme } of this.object?.surfaces ?? []) if (scheme) schemes[scheme] = (schemes[scheme] ?? 0) + 1;
    return {
      fps: this.frames.fps,
      frameMs: this.frames.lastMs,
      drawCalls: render.calls,
      triangles: render.triangles,
      textureBytes: this.object?.bytes ?? 0,
      budgetBytes: this.options.budget,
      firstPictureMs: this.firstPictureMs,
      codec: String(this.object?.field.container.plan.settings.codec ?? ''),
      schemes,
      busy: this.working > 0,
    };
  }

  dispose(): void {
    this.frames.stop();
    this.listening.abort();
    this.controls.dispose();
    this.object?.dispose();
    if (this.latest !== this.object) this.latest?.dispose();
    this.latest = null;
    this.painter.dispose();
    this.renderer.dispose();
  }

  private draw(now: number): void {
    const { object, options } = this;
    if (this.autoRotate && object) {
      this.controls.rotate(Math.min(0.1, (now - (this.rotatedAt || now)) / 1000));
      this.rotatedAt = now;
      this.frames.request();
    } else {
      this.rotatedAt = 0;
    }
    if (object) {
      object.uniforms.lfExposure.value = options.exposure;
      object.uniforms.lfTexelGrid.value = options.texelGrid ? 1 : 0;
    }
    this.fitClipPlanes();
    this.renderer.info.reset();
    this.painter.draw(this.scene, this.camera, object, options.mode, options.hardware);
  }

  /** Clip planes around the scene as the eye sees it: depth is precise from a millimetre to a cathedral. */
  private fitClipPlanes(): void {
    if (!this.object) return;
    const { low, high } = this.object.field.bounds;
    const centre = new Vector3(...low).add(new Vector3(...high)).multiplyScalar(0.5);
    const radius = this.sceneRadius();
    const distance = this.camera.position.distanceTo(centre);
    this.camera.near = Math.max(distance - radius * 1.01, radius * 1e-3);
    this.camera.far = distance + radius * 1.01;
    this.camera.updateProjectionMatrix();
  }

  private sceneRadius(): number {
    if (!this.object) return 1;
    const { low, high } = this.object.field.bounds;
    return length(sub(high, low)) / 2 || 1;
  }

  private cameraMoved(): void {
    this.frames.request();
    this.events.cameraChange();
  }

  /** Counts what is under way, for {@link ViewerStats.busy}. */
  private async during(work: () => Promise<void>): Promise<void> {
    this.working++;
    try {
      await work();
    } finally {
      this.working--;
    }
  }

  private replace(object: LightFieldObject): void {
    const before = this.object;
    this.object = object;
    this.scene.clear();
    this.scene.add(object);
    before?.dispose();
    if (!this.placed) this.home();
    this.changed(object);
  }

  private changed(object: LightFieldObject): void {
    if (object !== this.object) return;
    this.frames.request();
    this.events.model();
  }

  /** What fails for a field that is gone is nobody's concern. */
  private failed(object: LightFieldObject, error: Error): void {
    if (object !== this.latest || error.name === 'AbortError') return;
    this.events.error({ type: 'loadfailure', message: error.message });
  }
}
