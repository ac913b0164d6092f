/**
 * Questions to the coordinator. An answer is a value, a refusal in the coordinator's own words, or `away` where nobody answers: three
 * things that pages tell apart, so none of them is an exception.
 */

/** `at` is the coordinator's clock when it answered, milliseconds since 1970, by its Date header. */
export type Answer<T> = { kind: 'ok'; value: T; at: number } | { kind: 'refused'; status: number; detail: string } | { kind: 'away' };

/** A list or a record is answered at once or not at all. */
const PATIENCE_MS = 10_000;
/** What a proxy says while the coordinator behind it is away. */
const AWAY = new Set([502, 503, 504]);

/** Who wants to know that the service asks for an access token, or does not any more. */
let access: (locked: boolean) => void = () => {};

/** Tells `listener` at every question whether the service asks for a token before it answers. */
export function watchAccess(listener: (locked: boolean) => void): void {
  access = listener;
}

/** An address of the service: relative to the document's base, so that the pages work under any path. */
export const serviceUrl = (path: string): string => new URL(path, document.baseURI).href;

/** Asks for JSON. */
export async function askJson<T>(path: string): Promise<Answer<T>> {
  const answer = await ask(path, { signal: AbortSignal.timeout(PATIENCE_MS) }, (response) => response.json() as Promise<T>);
  if (answer.kind === 'refused' && answer.status === 401) access(true);
  if (answer.kind === 'ok') access(false);
  return answer;
}

/** Asks for bytes: scenes and segments, which may take long. */
export function askBytes(path: string, signal: AbortSignal): Promise<Answer<ArrayBuffer>> {
  return ask(path, { signal }, (response) => response.arrayBuffer());
}

/** Asks for something to be done. */
export function send(method: 'POST' | 'DELETE', path: string): Promise<Answer<null>> {
  return ask(path, { method, signal: AbortSignal.timeout(PATIENCE_MS) }, () => Promise.resolve(null));
}

/** Sends JSON, and reads the JSON of the answer. */
export function sendJson<T>(method: 'POST', path: string, body: unknown): Promise<Answer<T>> {
  const init = { method, body: JSON.stringify(body), headers: { 'content-type': 'application/json' }, signal: AbortSignal.timeout(PATIENCE_MS) };
  return ask(path, init, (response) => response.json() as Promise<T>);
}

async function ask<T>(path: string, init: RequestInit, read: (response: Response) => Promise<T>): Promise<Answer<T>> {
  try {
    const response = await fetch(serviceUrl(path), init);
    if (response.ok) return { kind: 'ok', value: await read(response), at: clock(response) };
    const detail = await problemDetail(response);
    if (detail === null && AWAY.has(response.status)) return { kind: 'away' };
    return { kind: 'refused', status: response.status, detail: detail ?? `the coordinator answered ${response.status} ${response.statusText}` };
  } catch {
    return { kind: 'away' };
  }
}

function clock(response: Response): number {
  const date = Date.parse(response.headers.get('date') ?? '');
  return Number.isNaN(date) ? Date.now() : date;
}

/** The sentence of a problem (RFC 9457); null where the body is none. */
async function problemDetail(response: Response): Promise<string | null> {
  if (!response.headers.get('content-type')?.startsWith('application/problem+json')) return null;
  const { detail, title } = (await response.json()) as { detail?: string; title?: string };
  return detail ?? title ?? null;
}
