/**
 * Keeps the camera of a viewer and the fragment of the page's address together. The address is replaced, not pushed: the back button leaves the
 * page rather than undoing a drag.
 */

import type { KilnViewerElement } from '../viewer/api.ts';
import { type HashCamera, formatHash, parseHash } from './hash.ts';

/** Browsers refuse pages that change their address more than a hundred times in 30 s. */
const THROTTLE_MS = 400;

/** Begins. The camera that the address holds now is taken as soon as the viewer has something to look at. */
export function syncCameraWithHash(viewer: KilnViewerElement): void {
  let timer: number | undefined;
  // Read now: the viewer's own first camera is written over it.
  let asked = parseHash(location.hash);

  const place = ({ eye, target, fieldOfView }: HashCamera) => viewer.setCamera(eye, target, fieldOfView);
  const begin = () => {
    if (asked && viewer.model) {
      place(asked);
      asked = null;
    }
  };
  begin();
  viewer.addEventListener('model', begin);
  viewer.addEventListener('load', begin);
  window.addEventListener('hashchange', () => {
    const camera = parseHash(location.hash);
    if (camera && viewer.model) place(camera);
    else asked = camera ?? asked;
  });
  viewer.addEventListener('camera-change', () => {
    timer ??= window.setTimeout(() => {
      timer = undefined;
      if (asked === null && viewer.model) writeHash(formatHash(viewer.getCamera()));
    }, THROTTLE_MS);
  });
}

/** A bare fragment would be resolved against <base>, which is another page. */
function writeHash(hash: string): void {
  if (hash !== location.hash) history.replaceState(null, '', location.pathname + location.search + hash);
}

/** The address of the page with the viewer's present camera. */
export function linkToView(viewer: KilnViewerElement): string {
  return new URL(viewer.model ? formatHash(viewer.getCamera()) : '', location.href).href;
}
