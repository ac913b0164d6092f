/** How a job is: state, progress, figures, what can be done with it. */

import { isFinal } from '../live/records.ts';
import type { FollowState } from '../live/state.ts';
import { serviceUrl } from '../live/http.ts';
import { Notice } from '../ui/announcer.ts';
import { Terms, el, setHidden, setText } from '../ui/dom.ts';
import { dateTime, rate, short } from '../ui/format.ts';
import { cancelJob, deleteJob } from '../ui/job-actions.ts';
import { elapsedText, progressText, settingText, stateText } from '../ui/job-text.ts';

/** Downloads of a finished job, relative to it. */
const DOWNLOADS: [string, string][] = [
  ['bundle.zip', 'Package as .zip'],
  ['bundle.tar.zst', 'Package as .tar.zst'],
  ['assets/manifest.json', 'Manifest'],
];

export class StatusPanel {
  readonly element = el('section', { class: 'panel', 'aria-labelledby': 'status-title' });
  private readonly title = el('h2', { id: 'status-title', tabindex: -1 }, 'State');
  private readonly state = el('span', { class: 'badge' });
  private readonly bar = el('progress', { max: 1, 'aria-label': 'Progress of this phase' });
  private readonly figures = el('p', { class: 'figures' });
  private readonly terms = new Terms();
  private readonly cancel = el('button', { type: 'button' }, 'Cancel');
  private readonly remove = el('button', { type: 'button' }, 'Delete');
  private readonly downloads = el('ul', { class: 'row downloads' });
  private readonly settings = new Terms();
  private readonly notice = new Notice();
  private current: FollowState | null = null;

  /** `refresh` is called when something was done to the job. */
  constructor(id: string, private readonly refresh: () => void) {
    for (const [path, text] of DOWNLOADS) {
      const href = serviceUrl(`v1/jobs/${encodeURIComponent(id)}/${path}`);
      this.downloads.append(el('li', {}, el('a', { href, download: path.endsWith('.json') ? null : '' }, text)));
    }
    this.element.append(
      el('div', { class: 'card-head' }, this.title, this.state),
      this.bar,
      this.figures,
      this.terms.element,
      this.downloads,
      el('div', { class: 'row' }, this.cancel, this.remove),
      this.notice.element,
      el('details', {}, el('summary', {}, 'Settings used'), this.settings.element),
    );
    this.cancel.addEventListener('click', () => void this.act(cancelJob));
    this.remove.addEventListener('click', () => void this.act(deleteJob));
    this.element.hidden = true;
  }

  update(state: FollowState): void {
    this.current = state;
    const { job } = state;
    this.element.hidden = job === null;
    if (!job) return;
    const { progress } = job;
    const over = isFinal(job.state);
    setText(this.state, stateText(job));
    this.state.dataset.state = job.state;
    this.bar.hidden = over;
    this.bar.value = progress.fraction;
    setText(this.figures, progressText(job));
    this.terms.set('Rays', over ? null : rate(progress.rays_per_second));
    this.terms.set('Rays traced', progress.rays > 0 ? short(progress.rays) : null);
    this.terms.set('Workers', over ? null : String(progress.workers));
    this.terms.set('Texels', progress.texels > 0 ? progress.texels.toLocaleString('en') : null);
    this.terms.set('Baking took', over ? elapsedText(job, Date.now()) : null);
    this.terms.set('Submitted', dateTime(job.created_ms));
    this.terms.set('Priority', job.priority === 0 ? null : String(job.priority));
    for (const [name, value] of Object.entries(job.settings)) this.settings.set(name.replaceAll('_', ' '), settingText(value));
    setHidden(this.downloads, job.state !== 'done' || state.gone !== null, this.title);
    setHidden(this.remove, state.gone !== null, this.title);
    setHidden(this.cancel, over || state.gone !== null, this.remove, this.title);
  }

  private async act(action: typeof cancelJob): Promise<void> {
    const job = this.current?.job;
    if (!job) return;
    this.notice.show(null);
    const outcome = await action(job);
    if (outcome === 'done') this.refresh();
    else if (outcome !== 'declined') this.notice.show({ role: 'alert', text: outcome.failure });
  }
}
