import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { KilnViewerElement } from '../viewer/api.ts';
import { LiveFeed, sceneWanted } from './feed.ts';
import type { JobRecord } from './records.ts';
import { INITIAL, type FollowState } from './state.ts';

const at = (state: JobRecord['state'], phase: JobRecord['phase'] = null) => ({ state, phase }) as JobRecord;
const state = (job: JobRecord, tiles = 0, over: Partial<FollowState> = {}): FollowState => ({
  ...INITIAL, job, baked: tiles > 0 ? [{ start: 0, end: tiles }] : [], ...over,
});

/** What the coordinator answers to `scene.kiln` and `segments`: a status, and the tiles of a body, one a byte. */
let answers: { scene: number; segments: (runs: string) => number[] };
let asked: string[];
let viewer: EventTarget & { log: string[]; model: object | null; src: string };

beforeEach(() => {
  vi.useFakeTimers();
  fault = null;
  asked = [];
  answers = { scene: 200, segments: (runs) => [...Array(Number(runs.split('-')[1]) + 1).keys()] };
  vi.stubGlobal('document', { baseURI: 'http://farm/' });
  vi.stubGlobal('window', globalThis);
  vi.stubGlobal('fetch', async (url: string) => {
    const path = url.replace('http://farm/v1/jobs/7/', '');
    asked.push(path);
    if (path === 'scene.kiln') return new Response('scene', { status: answers.scene });
    return new Response(new Uint8Array(answers.segments(path.split('runs=')[1])));
  });
  viewer = Object.assign(new EventTarget(), {
    log: [] as string[],
    model: null as object | null,
    src: '',
    showLive() {
      viewer.log.push('scene');
      viewer.model = {};
      queueMicrotask(() => viewer.dispatchEvent(new Event('load')));
    },
    addSegments(body: ArrayBuffer) {
      viewer.log.push(`tiles ${[...new Uint8Array(body)].join(' ')}`);
      return [...new Uint8Array(body)];
    },
    getCamera: () => ({ eye: [1, 2, 3], target: [0, 0, 0], fieldOfView: 40 }),
    setCamera: (eye: number[]) => viewer.log.push(`camera ${eye.join(' ')}`),
  });
});
afterEach(() => {
  vi.unstubAllGlobals();
  vi.useRealTimers();
});

let fault: string | null;
const feed = () => new LiveFeed('7', viewer as unknown as KilnViewerElement, (sentence) => (fault = sentence));
const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);

test('the scene is wanted once before and once behind the barrier', () => {
  expect(sceneWanted(at('preparing'), null)).toBeNull();
  expect(sceneWanted(at('baking', 'probe'), null)).toBe('probe');
  expect(sceneWanted(at('baking', 'probe'), 'probe')).toBeNull();
  expect(sceneWanted(at('baking', 'bake'), 'probe')).toBe('bake');
  expect(sceneWanted(at('assembling'), 'bake')).toBeNull();
  expect(sceneWanted(at('assembling'), null)).toBe('bake');
  expect(sceneWanted(at('done'), null)).toBeNull();
});

test('a job is followed from its scene to its package', async () => {
  const it = feed();
  it.update(state(at('baking', 'probe')));
  await pass(200);
  it.update(state(at('baking', 'bake')));
  await pass(200);
  it.update(state(at('baking', 'bake'), 3));
  await pass(200);
  it.update(state(at('done'), 3));
  expect(viewer.log).toEqual(['scene', 'scene', 'tiles 0 1 2', 'camera 1 2 3']);
  expect(asked).toEqual(['scene.kiln', 'scene.kiln', 'segments?runs=0-2']);
  expect(viewer.src).toBe('http://farm/v1/jobs/7/assets/manifest.json');
});

test('tiles that a body did not hold are asked for again', async () => {
  answers.segments = (runs) => (runs === '0-3' ? [0, 1] : [2, 3]);
  const it = feed();
  it.update(state(at('baking', 'bake'), 4));
  await pass(500);
  expect(viewer.log).toEqual(['scene', 'tiles 0 1', 'tiles 2 3']);
  await pass(60_000);
  expect(asked.length).toBe(3);
});

test('a scene that is not there yet is asked for again, with pauses', async () => {
  answers.scene = 409;
  const it = feed();
  it.update(state(at('baking', 'probe')));
  await pass(5_000);
  expect(asked.length).toBe(3);
  answers.scene = 200;
  await pass(2_500);
  expect(viewer.log).toEqual(['scene']);
});

test('nobody is asked while the coordinator is away, or after the end', async () => {
  const it = feed();
  it.update(state(at('baking', 'bake'), 4, { awaySince: 1 }));
  await pass(10_000);
  it.update(state(at('cancelled'), 4));
  await pass(10_000);
  expect(asked).toEqual([]);
});

test('a package that an absence cut off is loaded again after it, and one that is damaged is not', () => {
  const set: string[] = [];
  Object.defineProperty(viewer, 'src', { set: (url: string) => set.push(url), get: () => set.at(-1) });
  const fail = () => viewer.dispatchEvent(new CustomEvent('error', { detail: { type: 'loadfailure' } }));
  const it = feed();
  it.update(state(at('done')));
  fail();
  it.update(state(at('done')));
  expect(set.length).toBe(1);
  it.update(state(at('done'), 0, { awaySince: 1 }));
  it.update(state(at('done')));
  it.update(state(at('done')));
  expect(set).toEqual([set[0], '', set[0]]);
});

const DAMAGED = 'A part of the job could not be shown: checksum. It is asked for again.';
const damageOnce = () =>
  vi.spyOn(viewer as unknown as KilnViewerElement, 'addSegments').mockImplementationOnce(() => {
    throw new Error('checksum');
  });

test('damaged segments are told until they came undamaged', async () => {
  damageOnce();
  const it = feed();
  it.update(state(at('baking', 'bake'), 2));
  await pass(200);
  expect(fault).toBe(DAMAGED);
  // What comes meanwhile does not stand for them.
  answers.segments = (runs) => (runs.startsWith('0') ? [0] : []);
  it.update(state(at('baking', 'bake'), 3));
  await pass(2_000);
  expect([fault, viewer.log.includes('tiles 0')]).toEqual([DAMAGED, true]);
  answers.segments = () => [1, 2];
  await pass(2_000);
  expect([fault, viewer.log.at(-1)]).toEqual([null, 'tiles 1 2']);
});

test('a job that ends asks for nothing again, and says so no more', async () => {
  damageOnce();
  const it = feed();
  it.update(state(at('baking', 'bake'), 2));
  await pass(200);
  it.update(state(at('failed'), 2));
  expect(fault).toBeNull();
});

test('a damaged scene is told until it came undamaged', async () => {
  vi.spyOn(viewer as unknown as KilnViewerElement, 'showLive').mockImplementationOnce(() => {
    throw new Error('checksum');
  });
  feed().update(state(at('baking', 'probe')));
  await pass(200);
  expect(fault).toBe(DAMAGED);
  await pass(2_500);
  expect([fault, viewer.log]).toEqual([null, ['scene']]);
});
