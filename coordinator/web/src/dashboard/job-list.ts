/** The list of jobs: which are asked for (state, how many), and their cards. */

import { type Answer, askJson } from '../live/http.ts';
import { JOB_STATES, type JobPage, type JobRecord } from '../live/records.ts';
import { Notice } from '../ui/announcer.ts';
import { el } from '../ui/dom.ts';
import { cancelJob, deleteJob } from '../ui/job-actions.ts';
import { JobCard } from './job-card.ts';

/** Jobs of the first page, and how many more each press of the button shows. */
const STEP = 20;
/** Of the API: jobs of one answer. */
const LIMIT = 1_000;

export class JobList {
  readonly element = el('div', { class: 'job-list' });
  private readonly list = el('ul', { class: 'cards' });
  private readonly none = el('p', { class: 'hint', hidden: true });
  private readonly more = el('button', { type: 'button', hidden: true }, 'Show more jobs');
  private readonly filter = el('select', {}, el('option', { value: '' }, 'all'), ...JOB_STATES.map((state) => el('option', { value: state }, state)));
  private readonly notice = new Notice();
  private readonly cards = new Map<string, JobCard>();
  private wanted = STEP;
  /** Place of the job that the focus goes to when more are shown. */
  private reading: number | null = null;

  /** `changed` is called when another list is wanted. */
  constructor(private readonly changed: () => void) {
    const label = el('label', { class: 'field' }, el('span', {}, 'Show jobs that are'), this.filter);
    this.element.append(label, this.notice.element, this.list, this.none, this.more);
    this.filter.addEventListener('change', () => {
      this.wanted = STEP;
      changed();
    });
    this.more.addEventListener('click', () => {
      this.reading = this.cards.size;
      this.wanted += STEP;
      changed();
    });
  }

  /** Asks for as many jobs as are shown, page by page; the first answer that is no page ends it. */
  async load(): Promise<Answer<JobPage>> {
    const [jobs, state, wanted]: [JobRecord[], string, number] = [[], this.filter.value, this.wanted];
    let next: string | null = null;
    for (;;) {
      const query = new URLSearchParams({ limit: String(Math.min(LIMIT, wanted - jobs.length)) });
      if (state) query.set('state', state);
      if (next) query.set('cursor', next);
      const answer: Answer<JobPage> = await askJson<JobPage>(`v1/jobs?${query}`);
      if (answer.kind !== 'ok') return answer;
      jobs.push(...answer.value.jobs);
      next = answer.value.next;
      if (!next || jobs.length >= wanted) return { ...answer, value: { jobs, next } };
    }
  }

  update({ jobs, next }: JobPage, at: number): void {
    const shown = new Set(jobs.map(({ id }) => id));
    for (const [id, card] of this.cards) {
      if (shown.has(id)) continue;
      this.leave(card);
      this.cards.delete(id);
    }
    jobs.forEach((job, n) => this.place(job, n, at));
    this.readOn(jobs);
    this.more.hidden = next === null;
    this.none.hidden = jobs.length > 0;
    this.none.textContent = this.filter.value ? `No job is ${this.filter.value}.` : 'There are no jobs yet. The box below says how to submit one.';
  }

  private place(job: JobRecord, n: number, at: number): void {
    let card = this.cards.get(job.id);
    if (!card) {
      card = new JobCard(job, (action, of) => void this.act(action, of));
      this.cards.set(job.id, card);
    }
    card.update(job, at);
    // Moving an element takes the focus from what is in it: only where it is not in its place.
    if (this.list.children[n] !== card.element) this.list.insertBefore(card.element, this.list.children[n] ?? null);
  }

  /** The button may go once it has done its work: the focus is then where the new jobs begin. */
  private readOn(jobs: JobRecord[]): void {
    const job = this.reading === null ? undefined : jobs[this.reading];
    if (!job) return;
    this.cards.get(job.id)?.focus();
    this.reading = null;
  }

  /** A card that goes hands the focus to the list's filter. */
  private leave({ element }: JobCard): void {
    const focused = element.contains(document.activeElement);
    element.remove();
    if (focused) this.filter.focus();
  }

  private async act(action: 'cancel' | 'delete', job: JobRecord): Promise<void> {
    this.notice.show(null);
    const outcome = await (action === 'cancel' ? cancelJob(job) : deleteJob(job));
    if (outcome === 'done') this.changed();
    else if (outcome !== 'declined') this.notice.show({ role: 'alert', text: outcome.failure });
  }
}
