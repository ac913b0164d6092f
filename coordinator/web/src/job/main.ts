/** The page of a job: the viewer, fed with what is baked, and what there is to know about the job. */

import '../viewer/element.ts';
import '../ui/theme.css';
import '../ui/content.css';
import '../ui/panel.css';
import '../ui/viewing.css';
import { LiveFeed } from '../live/feed.ts';
import { JobFollower, RETRY_MS } from '../live/follower.ts';
import { serviceUrl } from '../live/http.ts';
import { messageFor } from '../live/messages.ts';
import type { FollowState } from '../live/state.ts';
import { Announcer, Notice } from '../ui/announcer.ts';
import { byId, el, installSkipLink, setText } from '../ui/dom.ts';
import { inspectorPanel } from '../ui/inspector.ts';
import { jobName, progressText, stateText } from '../ui/job-text.ts';
import type { ErrorDetail, KilnViewerElement } from '../viewer/api.ts';
import { StatusPanel } from './status.ts';
import { SurfaceTable } from './surfaces.ts';

const id = decodeURIComponent(location.pathname.split('/').pop() ?? '');
const previewUrl = (width: number, height: number) => serviceUrl(`v1/jobs/${encodeURIComponent(id)}/preview.png?w=${width}&h=${height}`);

const notice = new Notice();
const fault = new Notice();
const said = new Announcer();
const status = new StatusPanel(id, () => follower.refresh());
const surfaces = new SurfaceTable();
const viewer = document.createElement('kiln-viewer') as KilnViewerElement;
/** Without WebGL 2 the page shows the picture that the coordinator makes. */
let picture: HTMLImageElement | null = null;
let spoken = '';

viewer.setAttribute('camera-controls', '');
viewer.addEventListener('error', (event) => {
  const { type } = (event as Event as CustomEvent<ErrorDetail>).detail;
  if (type === 'webgl') picture = el('img', { class: 'picture', hidden: true, width: 960, height: 720 });
  // Whether the package or the coordinator is to blame.
  if (type === 'loadfailure') follower.refresh();
});
viewer.addEventListener('load', () => fault.show(null));
viewer.addEventListener('model', () => draw(follower.state));
byId('view').append(viewer);
if (picture) {
  byId('view').classList.add('without-webgl');
  byId('view').append(picture);
}

const feed = picture ? null : new LiveFeed(id, viewer, (sentence) => fault.show({ role: 'alert', text: sentence }));
const follower = new JobFollower(id, (state) => {
  draw(state);
  feed?.update(state);
});

function draw(state: FollowState): void {
  const { job } = state;
  notice.show(messageFor(state, RETRY_MS / 1000));
  status.update(state);
  surfaces.update(viewer.model, job?.state === 'done' ? null : state.baked);
  if (!job) return;
  const name = jobName(job);
  setText(byId('title'), name);
  document.title = `${name} – ${stateText(job)} – Kiln`;
  viewer.alt = `Baked scene of ${name}`;
  if (picture && job.state === 'done') showPicture(picture, name);
  // A change of state, and every tenth of the way.
  const step = `${stateText(job)} ${Math.floor(job.progress.fraction * 10)}`;
  if (step !== spoken) said.say(`${stateText(job)}: ${progressText(job)}`);
  spoken = step;
}

function showPicture(image: HTMLImageElement, name: string): void {
  if (image.src) return;
  image.alt = `${name}, seen from a camera of the coordinator's choice`;
  image.hidden = false;
  image.addEventListener('error', () => (image.hidden = true));
  image.src = previewUrl(image.width, image.height);
}

installSkipLink();
byId('notices').append(notice.element, fault.element, said.element);
byId('side').append(status.element);
if (!picture) byId('side').append(inspectorPanel(viewer, () => byId('title').textContent ?? 'kiln'));
byId('surfaces').append(surfaces.element);
follower.start();
