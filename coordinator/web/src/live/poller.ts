/**
 * Work that repeats while somebody looks: never two at a time, not at all while the page is hidden, and at once when it is shown again.
 */

export class Poller {
  private timer: number | undefined;
  private busy = false;
  private again = false;
  private stopped = true;

  /** `work` returns the milliseconds until it wants to be called again. It must not throw. */
  constructor(private readonly work: () => Promise<number>) {}

  start(): void {
    this.stopped = false;
    document.addEventListener('visibilitychange', this.onVisibility);
    this.soon();
  }

  stop(): void {
    this.stopped = true;
    document.removeEventListener('visibilitychange', this.onVisibility);
    clearTimeout(this.timer);
  }

  /** Works now rather than when its time comes, or once more where it is at work: what it asks may have changed since. */
  soon(): void {
    clearTimeout(this.timer);
    this.again = this.busy;
    void this.turn();
  }

  private readonly onVisibility = (): void => {
    if (document.hidden) clearTimeout(this.timer);
    else this.soon();
  };

  private async turn(): Promise<void> {
    if (this.busy || this.stopped || document.hidden) return;
    this.busy = true;
    const pause = await this.work().finally(() => (this.busy = false));
    const rest = this.again ? 0 : pause;
    this.again = false;
    if (!this.stopped && !document.hidden) this.timer = window.setTimeout(() => void this.turn(), rest);
  }
}
