/**
 * A picture that the coordinator draws of a finished job. It draws few at once and refuses the rest, so a picture that did not come is
 * asked for again, ever more rarely: why it did not come, an image element does not tell, and some packages will never have one.
 */

import { serviceUrl } from '../live/http.ts';
import { el } from './dom.ts';

/** Until the second request; each later pause is twice as long as the one before. */
const PAUSE_MS = 4_000;

export class PreviewPicture {
  private failures = 0;
  private notBefore = 0;

  /** In `place`, which stays empty while there is no picture; width and height in pixels. */
  constructor(
    private readonly place: HTMLElement,
    private readonly job: string,
    private readonly size: { width: number; height: number },
  ) {}

  /** Asks where there is none and its time has come. `attributes` are the image's, with its `alt`. */
  show(attributes: Record<string, string>): void {
    if (this.place.hasChildNodes() || performance.now() < this.notBefore) return;
    const { width, height } = this.size;
    const src = serviceUrl(`v1/jobs/${encodeURIComponent(this.job)}/preview.png?w=${width}&h=${height}`);
    const image = el('img', { ...attributes, width, height, src });
    image.addEventListener('error', () => {
      // A broken-picture sign would say less than nothing.
      image.remove();
      this.notBefore = performance.now() + PAUSE_MS * 2 ** this.failures++;
    });
    this.place.append(image);
  }
}
