/**
 * Orbiting by mouse, touch and keyboard. The pointer is three's OrbitControls; keys move the same camera, since a view that only a mouse
 * can turn shuts people out. Nothing is damped: frames are drawn when something changes, and a view that glides on draws for seconds after
 * every touch.
 */

import { type PerspectiveCamera, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { OrbitPosition } from './api.ts';

/** Radians an arrow key turns. */
const TURN = Math.PI / 36;
/** Share of the distance that an arrow key pans, and the zoom of a key. */
const PAN = 0.06;
const ZOOM = 1.12;
/** Radians a second of auto-rotation; a turn in about half a minute. */
const ROTATION = 0.2;
/** Nearest and farthest inclination: at the poles, azimuth has no meaning. */
const POLE = 0.01;

export class ViewControls {
  readonly camera: PerspectiveCamera;
  private readonly orbit: OrbitControls;
  private readonly canvas: HTMLCanvasElement;
  private readonly changed: () => void;
  private readonly taken: () => void;
  private home: (() => void) | null = null;
  private readonly onKey = (event: KeyboardEvent) => this.key(event);

  /** `changed` is called whenever the camera has moved, `taken` when a person begins to move it. */
  constructor(camera: PerspectiveCamera, canvas: HTMLCanvasElement, changed: () => void, taken: () => void) {
    this.camera = camera;
    this.canvas = canvas;
    this.changed = changed;
    this.orbit = new OrbitControls(camera, canvas);
    this.orbit.enabled = false;
    this.orbit.minPolarAngle = POLE;
    this.orbit.maxPolarAngle = Math.PI - POLE;
    this.orbit.addEventListener('change', changed);
    this.orbit.addEventListener('start', taken);
    this.taken = taken;
  }

  /** Whether people may move the camera. */
  set enabled(on: boolean) {
    this.orbit.enabled = on;
    this.canvas.removeEventListener('keydown', this.onKey);
    if (on) this.canvas.addEventListener('keydown', this.onKey);
  }

  /** What the Home key does. */
  set onHome(home: () => void) {
    this.home = home;
  }

  get target(): Vector3 {
    return this.orbit.target;
  }

  /** Places eye and target, metres; clip planes follow `radius`, the scene's. */
  place(eye: Vector3, target: Vector3, radius: number): void {
    this.camera.position.copy(eye);
    this.orbit.target.copy(target);
    this.orbit.maxDistance = Math.max(radius * 40, eye.distanceTo(target) * 2);
    this.orbit.minDistance = radius * 1e-3;
    this.update();
  }

  /** Applies what was set from outside. */
  update(): void {
    this.orbit.update();
    this.camera.updateMatrixWorld();
    this.changed();
  }

  /** Turns for the time that has passed, seconds. */
  rotate(seconds: number): void {
    this.turn(ROTATION * seconds, 0);
  }

  get position(): OrbitPosition {
    const s = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    return { theta: (s.theta * 180) / Math.PI, phi: (s.phi * 180) / Math.PI, radius: s.radius };
  }

  set position({ theta, phi, radius }: OrbitPosition) {
    const inclination = Math.min(Math.PI - POLE, Math.max(POLE, (phi * Math.PI) / 180));
    this.camera.position.setFromSpherical(new Spherical(radius, inclination, (theta * Math.PI) / 180)).add(this.target);
    this.update();
  }

  dispose(): void {
    this.enabled = false;
    this.orbit.dispose();
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const pan = event.shiftKey;
    const act: Record<string, () => void> = {
      ArrowLeft: () => (pan ? this.pan(-PAN, 0) : this.turn(-TURN, 0)),
      ArrowRight: () => (pan ? this.pan(PAN, 0) : this.turn(TURN, 0)),
      ArrowUp: () => (pan ? this.pan(0, PAN) : this.turn(0, -TURN)),
      ArrowDown: () => (pan ? this.pan(0, -PAN) : this.turn(0, TURN)),
      '+': () => this.zoom(1 / ZOOM),
      '=': () => this.zoom(1 / ZOOM),
      PageUp: () => this.zoom(1 / ZOOM),
      '-': () => this.zoom(ZOOM),
      _: () => this.zoom(ZOOM),
      PageDown: () => this.zoom(ZOOM),
      Home: () => this.home?.(),
    };
    const action = act[event.key];
    if (!action) return;
    event.preventDefault();
    this.taken();
    action();
  }

  private turn(theta: number, phi: number): void {
    const s = new Spherical().setFromVector3(this.camera.position.clone().sub(this.target));
    s.theta += theta;
    s.phi = Math.min(Math.PI - POLE, Math.max(POLE, s.phi + phi));
    this.camera.position.setFromSpherical(s).add(this.target);
    this.update();
  }

  private pan(x: number, y: number): void {
    const distance = this.camera.position.distanceTo(this.target);
    const move = new Vector3(x * distance, y * distance, 0).applyQuaternion(this.camera.quaternion);
    this.camera.position.add(move);
    this.target.add(move);
    this.update();
  }

  private zoom(factor: number): void {
    const offset = this.camera.position.clone().sub(this.target);
    const distance = Math.min(this.orbit.maxDistance, Math.max(this.orbit.minDistance, offset.length() * factor));
    this.camera.position.copy(this.target).add(offset.setLength(distance));
    this.update();
  }
}
