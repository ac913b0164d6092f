/**
 * The camera in the fragment of a page's address, `#eye=x,y,z&target=x,y,z&fov=f` in metres and degrees, or `#camera=NAME` for one of the
 * author's: so that a view can be bookmarked, sent and written by hand. Anything malformed is no camera; other parts of the fragment are
 * ignored.
 */

export interface HashCamera {
  eye: [number, number, number];
  target: [number, number, number];
  /** Vertical, degrees. */
  fieldOfView: number;
}

/** Decimals: a tenth of a millimetre. */
const DECIMALS = 4;
const FIELD_OF_VIEW = { least: 1, most: 170, usual: 45 };

/** The fragment for a camera, with its `#`. */
export function formatHash({ eye, target, fieldOfView }: HashCamera): string {
  const list = (values: number[]) => values.map(decimal).join(',');
  return `#eye=${list(eye)}&target=${list(target)}&fov=${decimal(fieldOfView)}`;
}

/** The fragment for one of the author's cameras. */
export const formatNamed = (name: string): string => `#${new URLSearchParams({ camera: name })}`;

/** The name of the author's camera that a fragment asks for; null where it asks for none. */
export const parseNamed = (hash: string): string | null => new URLSearchParams(hash.replace(/^#/, '')).get('camera') || null;

/** The camera of a fragment; null where it has none. The field of view may be left out. */
export function parseHash(hash: string): HashCamera | null {
  const values = new URLSearchParams(hash.replace(/^#/, ''));
  const eye = point(values.get('eye'));
  const target = point(values.get('target'));
  const fov = values.get('fov');
  const fieldOfView = fov === null ? FIELD_OF_VIEW.usual : number(fov);
  if (!eye || !target || fieldOfView === null) return null;
  const apart = eye.some((v, i) => v !== target[i]);
  return apart && fieldOfView >= FIELD_OF_VIEW.least && fieldOfView <= FIELD_OF_VIEW.most ? { eye, target, fieldOfView } : null;
}

function point(text: string | null): [number, number, number] | null {
  const values = (text ?? '').split(',').map(number);
  if (values.length !== 3 || values.includes(null)) return null;
  return values as [number, number, number];
}

/** A finite decimal number; Number() alone would take the empty string for 0. */
function number(text: string): number | null {
  const value = text.trim() === '' ? NaN : Number(text);
  return Number.isFinite(value) ? value : null;
}

/** Without trailing zeros, and without a sign on zero. */
const decimal = (value: number): string => String(Number(value.toFixed(DECIMALS)) + 0);
