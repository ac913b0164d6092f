/**
 * One job of the dashboard's list. Made once and updated in place: a list that is built anew every two seconds would take the focus away.
 */

import { serviceUrl } from '../live/http.ts';
import { type JobRecord, isFinal, problemText } from '../live/records.ts';
import { el, setHidden, setText } from '../ui/dom.ts';
import { dateTime, rate } from '../ui/format.ts';
import { elapsedText, jobName, progressText, stateText } from '../ui/job-text.ts';
import { PreviewPicture } from '../ui/preview-picture.ts';

export class JobCard {
  readonly element: HTMLLIElement;
  job: JobRecord;
  private readonly link = el('a');
  private readonly state = el('span', { class: 'badge' });
  private readonly bar = el('progress', { max: 1 });
  private readonly figures = el('p', { class: 'figures' });
  private readonly remark = el('p', { class: 'remark' });
  private readonly times = el('p', { class: 'hint' });
  private readonly thumbnail = el('div', { class: 'thumbnail' });
  private readonly picture: PreviewPicture;
  private readonly cancel = el('button', { type: 'button' }, 'Cancel');
  private readonly remove = el('button', { type: 'button' }, 'Delete');

  /** `act` is called when a button is pressed. */
  constructor(job: JobRecord, act: (action: 'cancel' | 'delete', job: JobRecord) => void) {
    this.job = job;
    this.picture = new PreviewPicture(this.thumbnail, job.id, { width: 160, height: 120 });
    this.link.href = serviceUrl(`jobs/${encodeURIComponent(job.id)}`);
    this.cancel.addEventListener('click', () => act('cancel', this.job));
    this.remove.addEventListener('click', () => act('delete', this.job));
    const head = el('div', { class: 'card-head' }, el('h3', {}, this.link), this.state);
    const words = el('div', { class: 'card-words' }, head, this.bar, this.figures, this.remark, this.times);
    this.element = el('li', { class: 'card' }, this.thumbnail, words, el('div', { class: 'card-actions' }, this.cancel, this.remove));
    this.update(job, Date.now());
  }

  /** `at` is the coordinator's clock. */
  update(job: JobRecord, at: number): void {
    this.job = job;
    const name = jobName(job);
    const { progress } = job;
    setText(this.link, name);
    setText(this.state, stateText(job));
    this.state.dataset.state = job.state;
    this.bar.hidden = isFinal(job.state);
    this.bar.value = progress.fraction;
    this.bar.setAttribute('aria-label', `Progress of ${name}`);
    setHidden(this.cancel, isFinal(job.state), this.remove);
    this.cancel.setAttribute('aria-label', `Cancel ${name}`);
    this.remove.setAttribute('aria-label', `Delete ${name}`);
    const working = isFinal(job.state) ? [] : [`${progress.workers} ${progress.workers === 1 ? 'worker' : 'workers'}`, `${rate(progress.rays_per_second)} rays`];
    setText(this.figures, [progressText(job), ...working].join(' · '));
    setText(this.remark, job.problem ? problemText(job.problem) : job.waiting ? `Waiting: ${job.waiting}` : '');
    this.remark.classList.toggle('bad', job.problem !== null);
    const took = elapsedText(job, at);
    setText(this.times, `Submitted ${dateTime(job.created_ms)}${took ? `, ${isFinal(job.state) ? 'took' : 'baking for'} ${took}` : ''}`);
    // Decoration.
    if (job.state === 'done') this.picture.show({ loading: 'lazy', alt: '' });
  }

  focus(): void {
    this.link.focus();
  }
}
