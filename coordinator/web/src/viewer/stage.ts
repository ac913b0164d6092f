/**
 * What `<kiln-viewer>` shows: a renderer on a canvas, one light field at a time, a camera, and what it takes to get a frame of them. The
 * element around it knows attributes and events, this knows three.js.
 *
 * Every wait ends in a look whether its result is still wanted: pages change their mind while megabytes are on their way.
 */

import { Scene, PerspectiveCamera, Vector2, Vector3, WebGLRenderer } from 'three';
import { type Camera, DEFAULT_FIELD_OF_VIEW } from '../field/camera.ts';
import { type LightField, makeLiveField } from '../field/light-field.ts';
import { parseContainer } from '../format/container.ts';
import { parseSegments } from '../format/segment.ts';
import { LightFieldObject } from '../gl/object.ts';
import { Painter } from '../gl/painter.ts';
import type { ErrorDetail, TexelSample, ViewerStats } from './api.ts';
import { ViewControls } from './controls.ts';
import { type CameraGoals, firstView, fitClipPlanes, sceneRadius } from './first-view.ts';
import { Frames } from './frames.ts';
import { statsOf } from './model.ts';
import { type StageOptions, usualOptions } from './options.ts';
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

export class Stage {
  readonly controls: ViewControls;
  readonly frames: Frames;
  readonly options: StageOptions = usualOptions();
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
   * Shows a field; resolves when its first complete picture can be drawn, at once where another has replaced it meanwhile. What is shown
   * now stays until then, if the budget has room for both: a job that has just been baked does not fall back to its draft.
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

  /** The first view. */
  home(): void {
    if (!this.object) return;
    this.placed = false;
    this.put(firstView(this.object.field, this.goals, this.camera.aspect));
    if (this.goals.orbit) this.controls.position = this.goals.orbit;
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
    const radius = this.object ? sceneRadius(this.object.field.bounds) : 1;
    this.controls.place(new Vector3(...eye), new Vector3(...target), radius);
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
    this.setLook(this.object);
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
    const { frames, firstPictureMs } = this;
    const drawing = { fps: frames.fps, frameMs: frames.lastMs, budgetBytes: this.options.budget, firstPictureMs, busy: this.working > 0 };
    return statsOf(this.object, this.renderer, drawing);
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
    if (object) this.setLook(object);
    this.fitClipPlanes();
    this.renderer.info.reset();
    this.painter.draw(this.scene, this.camera, object, options.mode, options.hardware);
  }

  private setLook({ uniforms, background }: LightFieldObject): void {
    const { exposure, texelGrid, environment } = this.options;
    uniforms.lfExposure.value = exposure;
    uniforms.lfTexelGrid.value = texelGrid ? 1 : 0;
    if (background) background.visible = environment;
  }

  private fitClipPlanes(): void {
    if (this.object) fitClipPlanes(this.camera, this.object.field.bounds);
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
