/** Cancelling and deleting a job, with the question before it: the same on the dashboard and on the job's page. */

import { send } from '../live/http.ts';
import type { JobRecord } from '../live/records.ts';
import { confirmAction } from './confirm.ts';
import { jobName } from './job-text.ts';

/** What became of it: done, not wanted after all, or a sentence that says why not. */
export type Outcome = 'done' | 'declined' | { failure: string };

export function cancelJob(job: JobRecord): Promise<Outcome> {
  const question = `Cancel ${jobName(job)}? What it has baked so far is lost.`;
  return act(question, 'Cancel the job', () => send('POST', `v1/jobs/${encodeURIComponent(job.id)}/cancel`));
}

export function deleteJob(job: JobRecord): Promise<Outcome> {
  const question = `Delete ${jobName(job)}? Its package is removed from the coordinator and cannot be brought back.`;
  return act(question, 'Delete the job', () => send('DELETE', `v1/jobs/${encodeURIComponent(job.id)}`));
}

async function act(question: string, action: string, work: () => ReturnType<typeof send>): Promise<Outcome> {
  if (!(await confirmAction(question, action))) return 'declined';
  const answer = await work();
  if (answer.kind === 'ok') return 'done';
  return { failure: answer.kind === 'away' ? 'The coordinator does not answer; try again when it is back.' : `The coordinator refused: ${answer.detail}` };
}
