/** Whether a job's page has anything to look at. An empty view with an inspector beside it would let people wait for what never comes. */

import { isFinal } from '../live/records.ts';
import type { FollowState } from '../live/state.ts';

/** What stands in the place of the view; null where there is a picture, or may come one. `shown` says whether something is drawn. */
export function emptyText({ job, gone }: FollowState, shown: boolean): string | null {
  if (shown) return null;
  if (gone) return 'There is nothing to show.';
  if (job && isFinal(job.state) && job.state !== 'done') return 'There is nothing to show: tiles of a job that did not finish are not kept.';
  return null;
}
