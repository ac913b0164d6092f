import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import { askJson, watchAccess } from './http.ts';
import { logIn, logOut } from './session.ts';

let answers: Response[];
let asked: { url: string; init: RequestInit }[];
let told: boolean[];

const json = (status: number, body: unknown, type = 'application/json'): Response =>
  new Response(JSON.stringify(body), { status, headers: { 'content-type': type } });
const problem = (status: number, detail: string): Response => json(status, { detail }, 'application/problem+json');

beforeEach(() => {
  [answers, asked, told] = [[], [], []];
  vi.stubGlobal('document', { baseURI: 'http://farm/kiln/' });
  vi.stubGlobal('fetch', async (url: string, init: RequestInit) => {
    asked.push({ url, init });
    return answers.shift();
  });
  watchAccess((locked) => told.push(locked));
});
afterEach(() => vi.unstubAllGlobals());

test('a token is sent once, in the body, and what comes back is who it is', async () => {
  const session = { token: 'abc', name: 'ann', roles: ['submit'], expires_ms: 5 };
  answers = [json(200, session)];
  expect(await logIn(' kiln_abc_secret\n')).toMatchObject({ kind: 'ok', value: session });
  expect(asked[0]?.url).toBe('http://farm/kiln/v1/session');
  expect(asked[0]?.init).toMatchObject({ method: 'POST', body: '{"token":"kiln_abc_secret"}', headers: { 'content-type': 'application/json' } });
  expect(told).toEqual([]);
});

test('a token that is not accepted is told in the words of the service', async () => {
  answers = [problem(401, 'the access token is not accepted: it was revoked')];
  expect(await logIn('x')).toEqual({ kind: 'refused', status: 401, detail: 'the access token is not accepted: it was revoked' });
});

test('pages hear that a token is asked for, and that it is not any more', async () => {
  answers = [problem(401, 'this service asks for an access token'), problem(404, 'no job'), json(200, {})];
  for (let n = 0; n < 3; n++) await askJson('v1/jobs');
  expect(told).toEqual([true, false]);
});

test('logging out asks the service to take the cookie back', async () => {
  answers = [new Response(null, { status: 204 })];
  expect(await logOut()).toMatchObject({ kind: 'ok' });
  expect(asked[0]?.init.method).toBe('DELETE');
});
