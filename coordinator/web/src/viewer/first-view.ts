/** Where a scene is looked at from before anybody has moved the camera, and how far a view of it reaches. */

import { type PerspectiveCamera, Vector3 } from 'three';
import type { Vec3 } from '../format/bytes.ts';
import { type Camera, defaultCamera } from '../field/camera.ts';
import { add, length, scale, sub } from '../field/frame.ts';
import type { LightField } from '../field/light-field.ts';
import type { OrbitPosition } from './api.ts';
import { cameraNames, viewOf } from './cameras.ts';

/** What is asked of the first view; what is left out is chosen. */
export interface CameraGoals {
  orbit?: OrbitPosition;
  target?: [number, number, number];
  /** Vertical, degrees. */
  fieldOfView?: number;
  /** One of the author's cameras. */
  name?: string;
}

/** A box, metres. */
type Bounds = LightField['bounds'];

/**
 * The first view: what was asked of it but for the orbit, and for the rest the author's camera of that name, or what `field/camera.ts`
 * chooses.
 */
export function firstView(field: LightField, { target, fieldOfView, name }: CameraGoals, aspect: number): Camera {
  const chosen = firstCamera(field, name ?? '', fieldOfView, aspect);
  const centre: Vec3 = target ?? chosen.target;
  return { ...chosen, eye: add(centre, sub(chosen.eye, chosen.target)), target: centre };
}

function firstCamera({ container, bounds }: LightField, name: string, fieldOfView: number | undefined, aspect: number): Camera {
  const { cameras } = container.scene;
  const named = cameras[cameraNames(cameras).indexOf(name)];
  if (!named) return defaultCamera(container, aspect, fieldOfView);
  const view = viewOf(named, bounds, aspect);
  return { ...view, fieldOfView: fieldOfView ?? view.fieldOfView };
}

/** Of the sphere around a scene's box, metres; 1 for a scene without extent. */
export const sceneRadius = ({ low, high }: Bounds): number => length(sub(high, low)) / 2 || 1;

/** Clip planes around the scene as the eye sees it: depth is precise from a millimetre to a cathedral. */
export function fitClipPlanes(camera: PerspectiveCamera, bounds: Bounds): void {
  const centre = new Vector3(...scale(add(bounds.low, bounds.high), 0.5));
  const radius = sceneRadius(bounds);
  const distance = camera.position.distanceTo(centre);
  camera.near = Math.max(distance - radius * 1.01, radius * 1e-3);
  camera.far = distance + radius * 1.01;
  camera.updateProjectionMatrix();
}
