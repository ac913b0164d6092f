/** Which package a viewer page shows: the one beside it, or one that its address names. */

const BESIDE = 'package/manifest.json';

/**
 * The manifest's URL for a page at `base` with the query `search`. Null where `?src=` names another origin: a link to a page must not make
 * it load whatever its author likes.
 */
export function packageUrl(search: string, base: string): string | null {
  const asked = new URLSearchParams(search).get('src') ?? BESIDE;
  if (!URL.canParse(asked, base)) return null;
  const url = new URL(asked, base);
  return url.origin === new URL(base).origin && url.protocol === new URL(base).protocol ? url.href : null;
}
