/**
 * A browser's session with a service that asks for access tokens. The token goes to the service once and comes back as a cookie that no
 * script can read; this module never keeps it.
 */

import { type Answer, send, sendJson } from './http.ts';

export interface Session {
  /** The id of the token. */
  token: string;
  name: string;
  roles: string[];
  expires_ms: number;
}

/** Trades the text of a token for a session. */
export const logIn = (token: string): Promise<Answer<Session>> => sendJson<Session>('POST', 'v1/session', { token: token.trim() });

/** Makes the browser forget the session. */
export const logOut = (): Promise<Answer<null>> => send('DELETE', 'v1/session');
