/**
 * The right to hold an event stream. A browser opens six connections to a coordinator that speaks HTTP/1.1, for all its windows together,
 * and a stream keeps one for as long as it lasts: six windows on jobs would lock every page of that coordinator out. So the windows of a
 * browser share a few slots, which are Web Locks: the browser frees one when its window goes, however it goes.
 *
 * One window that streams for the others would serve two windows on one job better, and six windows on six jobs not at all; who has no slot
 * asks for the tiles instead. Web Locks exist in secure contexts alone (https, localhost): elsewhere each page that is shown has its own
 * stream.
 */

/** Streams of one browser: what is left of six connections is enough for records, tiles and packages. */
const SLOTS = 2;

export class StreamSlot {
  private free: (() => void) | null = null;

  /** Takes a slot, where none is held yet; whether one is held now. Not to be called again before it has answered. */
  async take(): Promise<boolean> {
    if (this.free || !navigator.locks) return true;
    for (let n = 0; n < SLOTS; n++) {
      if (await this.takeLock(`kiln-event-stream-${n}`)) return true;
    }
    return false;
  }

  release(): void {
    this.free?.();
    this.free = null;
  }

  private takeLock(name: string): Promise<boolean> {
    return new Promise((resolve) => {
      const held = navigator.locks.request(name, { ifAvailable: true }, (lock) => {
        resolve(lock !== null);
        // The lock is held until this promise resolves.
        return lock && new Promise<void>((free) => (this.free = free));
      });
      // Refused to a page that is being left.
      held.catch(() => resolve(false));
    });
  }
}
