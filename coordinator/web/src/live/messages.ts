/**
 * The sentence that a page shows about the job it follows, where there is something to say: what happened, and what to do about it. One at
 * a time, the gravest first; a list of them would be read by nobody.
 */

import { clockTime } from '../ui/format.ts';
import { type JobRecord, isFinal, problemText } from './records.ts';
import type { FollowState } from './state.ts';

export interface Message {
  /** `alert` interrupts a screen reader, `status` waits. */
  role: 'alert' | 'status';
  text: string;
}

/** What to say; null where all is well. */
export function messageFor(state: FollowState, retrySeconds: number): Message | null {
  if (state.gone === 'unknown') {
    return alert('There is no job of this id on this coordinator. Check the address, or choose a job from the list of jobs.');
  }
  if (state.gone === 'deleted') {
    return alert('This job was deleted while you watched it. What you see is still in this tab, but nothing more will come and it cannot be loaded again.');
  }
  if (state.awaySince !== null) {
    const rest = state.job ? 'What you see stays; the page goes on by itself when it is back.' : 'The page begins by itself when it is back.';
    return alert(`The coordinator does not answer since ${clockTime(state.awaySince)}; trying again every ${retrySeconds} s. ${rest}`);
  }
  if (state.refused !== null) {
    return alert(`The coordinator refuses to tell how this job is, and is asked again every ${retrySeconds} s: ${state.refused}`);
  }
  const own = state.job && jobMessage(state.job);
  if (own) return own;
  if (state.missed && state.job && !isFinal(state.job.state)) {
    return status('Some events of this job were missed while the page was not connected; its tiles were read again from the coordinator.');
  }
  return null;
}

function jobMessage(job: JobRecord): Message | null {
  switch (job.state) {
    case 'failed':
      return alert(`The job failed. ${job.problem ? problemText(job.problem) : 'The coordinator gave no reason; its log may.'}`);
    case 'cancelled':
      return status('The job was cancelled; nothing more of it is baked. Submit its scene again to bake all of it.');
    case 'queued':
    case 'preparing':
    case 'baking':
    case 'paused':
    case 'assembling':
      return job.waiting ? status(`Waiting: ${job.waiting}`) : null;
    case 'done':
      return null;
  }
}

const alert = (text: string): Message => ({ role: 'alert', text });
const status = (text: string): Message => ({ role: 'status', text });
