/** The page of a job: the viewer, fed with what is baked, and what there is to know about the job. */

import '../viewer/element.ts';
import '../ui/theme.css';
import '../ui/content.css';
import '../ui/panel.css';
import '../ui/viewing.css';
import { LiveFeed } from '../live/feed.ts';
import { JobFollower, RETRY_MS } from '../live/follower.ts';
import { messageFor } from '../live/messages.ts';
import type { FollowState } from '../live/state.ts';
import { Announcer, Notice } from '../ui/announcer.ts';
import { byId, el, installSkipLink, setHidden, setText } from '../ui/dom.ts';
import { inspectorPanel } from '../ui/inspector.ts';
import { jobName, progressText, stateText } from '../ui/job-text.ts';
import { LogIn } from '../ui/log-in.ts';
import { PreviewPicture } from '../ui/preview-picture.ts';
import type { ErrorDetail, KilnViewerElement } from '../viewer/api.ts';
import { emptyText } from './emptiness.ts';
import { StatusPanel } from './status.ts';
import { SurfaceTable } from './surfaces.ts';

const id = decodeURIComponent(location.pathname.split('/').pop() ?? '');

const notice = new Notice();
const fault = new Notice();
const said = new Announcer();
const status = new StatusPanel(id, () => follower.refresh());
const surfaces = new SurfaceTable();
const viewer = document.createElement('kiln-viewer') as KilnViewerElement;
/** In the view's place where there is nothing to see. */
const empty = el('p', { class: 'hint', hidden: true, tabindex: -1 });
/** Without WebGL 2: the picture that the coordinator makes. */
let picture: PreviewPicture | null = null;
let spoken = '';

viewer.setAttribute('camera-controls', '');
viewer.addEventListener('error', (event) => {
  const { type } = (event as Event as CustomEvent<ErrorDetail>).detail;
  if (type === 'webgl') picture = instead();
  // Whether the package or the coordinator is to blame.
  if (type === 'loadfailure') follower.refresh();
});
viewer.addEventListener('model', () => draw(follower.state));
byId('view').append(viewer, empty);

const inspector = picture ? null : inspectorPanel(viewer, () => byId('title').textContent ?? 'kiln');
const feed = picture ? null : new LiveFeed(id, viewer, (sentence) => fault.show(sentence === null ? null : { role: 'alert', text: sentence }));
const follower = new JobFollower(id, (state) => {
  draw(state);
  feed?.update(state);
});

function draw(state: FollowState): void {
  const { job } = state;
  notice.show(messageFor(state, RETRY_MS / 1000));
  status.update(state);
  const nothing = emptyText(state, viewer.model !== null);
  setText(empty, nothing ?? '');
  empty.hidden = nothing === null;
  for (const part of [viewer, inspector]) if (part) setHidden(part, nothing !== null, empty);
  surfaces.update(viewer.model, job?.state === 'done' ? null : state.baked);
  if (!job) return;
  const name = jobName(job);
  setText(byId('title'), name);
  document.title = `${name} – ${stateText(job)} – Kiln`;
  viewer.alt = `Baked scene of ${name}`;
  if (job.state === 'done') picture?.show({ class: 'picture', alt: `${name}, seen from a camera of the coordinator's choice` });
  // A change of state, and every tenth of the way.
  const step = `${stateText(job)} ${Math.floor(job.progress.fraction * 10)}`;
  if (step !== spoken) said.say(`${stateText(job)}: ${progressText(job)}`);
  spoken = step;
}

function instead(): PreviewPicture {
  const place = el('div');
  byId('view').classList.add('without-webgl');
  byId('view').append(place);
  return new PreviewPicture(place, id, { width: 960, height: 720 });
}

installSkipLink();
byId('notices').append(notice.element, new LogIn(() => follower.refresh()).element, fault.element, said.element);
byId('side').append(status.element);
if (inspector) byId('side').append(inspector);
byId('surfaces').append(surfaces.element);
follower.start();
