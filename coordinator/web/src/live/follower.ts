/**
 * Follows a job: asks for its record every two seconds, hears its events, and tells every change of what is known. All decisions are in
 * `state.ts`; this is the rim that talks.
 *
 * The browser's EventSource comes back by itself, with Last-Event-ID, after a broken connection, but gives up for good at any answer that
 * is no stream (a proxy's 502). So the record is what decides whether the coordinator is there, and a stream that was given up is opened
 * again, behind the last event, as soon as it is. The record alone would do for everything but the tiles.
 *
 * A page that is hidden has no stream, and of those that are shown only a few (`stream-slot.ts`): the others ask for the done tiles with
 * each record. Asking alone would be simpler, and show tiles up to two seconds later than they could be seen.
 */

import { serviceUrl, askJson } from './http.ts';
import { Poller } from './poller.ts';
import { type DoneTiles, type JobEvent, type JobRecord, type Snapshot, isFinal } from './records.ts';
import { type FollowState, INITIAL, type Input, apply } from './state.ts';
import { StreamSlot } from './stream-slot.ts';

/** Between two looks at a job that goes on, and at one that has ended and can only be deleted. */
export const RETRY_MS = 2_000;
const ENDED_MS = 10_000;
const EVENT_NAMES = ['state', 'tiles', 'problem'] as const;

export class JobFollower {
  state: FollowState = INITIAL;
  private source: EventSource | null = null;
  private readonly slot = new StreamSlot();
  private readonly poller = new Poller(() => this.poll());

  constructor(
    private readonly id: string,
    private readonly onChange: (state: FollowState) => void,
  ) {}

  start(): void {
    // The poller asks, and with it opens the stream, when the page is shown again.
    document.addEventListener('visibilitychange', () => document.hidden && this.close());
    this.poller.start();
  }

  /** Asks again now: after something was done to the job. */
  refresh(): void {
    this.poller.soon();
  }

  private feed(input: Input): void {
    const next = apply(this.state, input);
    if (next === this.state) return;
    this.state = next;
    this.onChange(next);
  }

  private async poll(): Promise<number> {
    const answer = await askJson<JobRecord>(this.path);
    if (answer.kind === 'ok') {
      this.feed({ kind: 'record', job: answer.value });
      if (isFinal(answer.value.state)) this.close();
      else await this.listen();
    } else if (answer.kind === 'refused' && answer.status === 404) {
      this.feed({ kind: 'not-found' });
      this.close();
    } else if (answer.kind === 'refused') {
      this.feed(answer);
    } else {
      this.feed({ kind: 'away', at: Date.now() });
    }
    const { job, awaySince, refused, gone } = this.state;
    return gone || (job && isFinal(job.state) && awaySince === null && refused === null) ? ENDED_MS : RETRY_MS;
  }

  /** Hears of tiles by the stream, where there may be one, else asks. */
  private async listen(): Promise<void> {
    if (document.hidden) return;
    const mayStream = await this.slot.take();
    // It may have been hidden while it waited.
    if (document.hidden) this.close();
    else if (mayStream) this.open();
    else await this.askTiles();
  }

  private async askTiles(): Promise<void> {
    const answer = await askJson<DoneTiles>(`${this.path}/tiles`);
    // Anything else the next record tells better.
    if (answer.kind === 'ok') this.feed({ kind: 'tiles', phase: answer.value.phase, runs: answer.value.runs });
  }

  private open(): void {
    if (this.source && this.source.readyState !== EventSource.CLOSED) return;
    const source = new EventSource(serviceUrl(`${this.path}/events?after=${this.state.seq}`));
    this.source = source;
    for (const name of EVENT_NAMES) {
      source.addEventListener(name, ({ data }: MessageEvent<string>) => this.hear(JSON.parse(data) as JobEvent));
    }
    source.addEventListener('snapshot', ({ data, lastEventId }: MessageEvent<string>) => {
      this.feed({ kind: 'snapshot', seq: Number(lastEventId), snapshot: JSON.parse(data) as Snapshot });
    });
    // The connection broke, the stream ended, or the job is gone: the record tells which.
    source.addEventListener('error', () => this.refresh());
  }

  private hear(event: JobEvent): void {
    this.feed({ kind: 'event', event });
    // What else changed with the state (the problem, the tiles of a new phase) is in the record.
    if (event.event === 'state' && event.state === this.state.job?.state) this.refresh();
  }

  private close(): void {
    this.source?.close();
    this.source = null;
    this.slot.release();
  }

  private get path(): string {
    return `v1/jobs/${encodeURIComponent(this.id)}`;
  }
}
