/**
 * Keeps the camera of a viewer and the fragment of the page's address together. The address is replaced, not pushed: the back button leaves
 * the page rather than undoing a drag.
 */

import type { KilnViewerElement } from '../viewer/api.ts';
import { type HashCamera, formatHash, formatNamed, parseHash, parseNamed } from './hash.ts';

/** Browsers refuse pages that change their address more than a hundred times in 30 s. */
const THROTTLE_MS = 400;

/** Begins. The camera that the address holds now is taken as soon as the viewer has something to look at. */
export function syncCameraWithHash(viewer: KilnViewerElement): void {
  let timer: number | undefined;
  // Read now: the viewer's own first camera is written over it.
  let asked = askedFor(location.hash);

  const place = (view: HashCamera | string) => {
    if (typeof view === 'string') viewer.cameraName = view;
    else viewer.setCamera(view.eye, view.target, view.fieldOfView);
  };
  const begin = () => {
    if (asked !== null && viewer.model) {
      place(asked);
      asked = null;
    }
  };
  begin();
  viewer.addEventListener('model', begin);
  viewer.addEventListener('load', begin);
  window.addEventListener('hashchange', () => {
    const view = askedFor(location.hash);
    if (view !== null && viewer.model) place(view);
    else asked = view ?? asked;
  });
  viewer.addEventListener('camera-change', () => {
    timer ??= window.setTimeout(() => {
      timer = undefined;
      if (asked === null && viewer.model) writeHash(fragment(viewer));
    }, THROTTLE_MS);
  });
}

/** A camera, or the name of one of the author's. */
const askedFor = (hash: string): HashCamera | string | null => parseHash(hash) ?? parseNamed(hash);

/** Named while the view is that of an author's camera: such a link follows the scene when its author moves the camera. */
function fragment(viewer: KilnViewerElement): string {
  const { cameraName, cameraMoved, model } = viewer;
  return !cameraMoved && model?.cameras.includes(cameraName) ? formatNamed(cameraName) : formatHash(viewer.getCamera());
}

/** A bare fragment would be resolved against <base>, which is another page. */
function writeHash(hash: string): void {
  if (hash !== location.hash) history.replaceState(null, '', location.pathname + location.search + hash);
}

/** The address of the page with the viewer's present camera. */
export function linkToView(viewer: KilnViewerElement): string {
  return new URL(viewer.model ? fragment(viewer) : '', location.href).href;
}
