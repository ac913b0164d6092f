/** The dashboard: asks for jobs, workers and throughput every two seconds while somebody looks, and draws what it is told. */

import '../ui/theme.css';
import '../ui/content.css';
import './dashboard.css';
import { type Answer, askJson, serviceUrl } from '../live/http.ts';
import { Poller } from '../live/poller.ts';
import type { Throughput, WorkerRecord } from '../live/records.ts';
import { Announcer, Notice } from '../ui/announcer.ts';
import { byId, installSkipLink, setText } from '../ui/dom.ts';
import { clockTime } from '../ui/format.ts';
import { jobName } from '../ui/job-text.ts';
import { LogIn } from '../ui/log-in.ts';
import { JobList } from './job-list.ts';
import { ThroughputView } from './throughput-view.ts';
import { Totals, WorkerTable } from './workers.ts';

const EVERY_MS = 2_000;

const notice = new Notice();
const said = new Announcer();
const jobs = new JobList(() => poller.soon());
const workers = new WorkerTable();
const totals = new Totals();
const throughput = new ThroughputView();
const names = new Map<string, string>();
let awaySince: number | null = null;
let count = -1;

const poller = new Poller(async () => {
  const [page, farm, work] = await Promise.all([
    jobs.load(),
    askJson<{ workers: WorkerRecord[] }>('v1/workers'),
    askJson<Throughput>('v1/throughput'),
  ]);
  tellFaults([page, farm]);
  if (page.kind === 'ok') {
    for (const job of page.value.jobs) names.set(job.id, jobName(job));
    jobs.update(page.value, page.at);
    if (page.value.jobs.length !== count) said.say(`${page.value.jobs.length} jobs are listed.`);
    count = page.value.jobs.length;
  }
  if (farm.kind === 'ok') {
    workers.update(farm.value.workers, farm.at, (id) => names.get(id) ?? jobName({ id, labels: {} }));
    totals.update(farm.value.workers);
  }
  if (work.kind === 'ok') throughput.update(work.value, work.at);
  // A coordinator that does not measure it leaves the page without the section.
  if (work.kind !== 'away') byId('throughput').hidden = work.kind !== 'ok';
  return EVERY_MS;
});

/** What is shown stays as it was: better old figures, and their age, than none. */
function tellFaults(answers: Answer<unknown>[]): void {
  const away = answers.some(({ kind }) => kind === 'away');
  const refused = answers.find((answer) => answer.kind === 'refused');
  awaySince = away ? (awaySince ?? Date.now()) : null;
  if (awaySince !== null) {
    notice.show({ role: 'alert', text: `The coordinator does not answer since ${clockTime(awaySince)}; trying again every ${EVERY_MS / 1000} s.` });
  } else {
    notice.show(refused ? { role: 'alert', text: `The coordinator refuses to tell how the farm is: ${refused.detail}` } : null);
  }
}

installSkipLink();
byId('notices').append(notice.element, new LogIn(() => poller.soon()).element, said.element);
byId('totals').append(totals.element);
byId('jobs').append(jobs.element);
byId('workers').append(workers.element);
byId('throughput').append(throughput.element);
const curl = `curl -F scene=@room.obj -F materials=@room.mtl \\\n  -F 'settings={"preset":"draft"}' ${serviceUrl('v1/bakes')}`;
setText(byId('submit-curl'), curl);
setText(byId('submit-kiln'), `kiln submit --server ${serviceUrl('.')} --label name=Room room.obj`);
poller.start();
