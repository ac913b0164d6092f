/**
 * Values of attributes; those of cameras in model-viewer's notation: `45deg 75deg 4m`, `0m 1m 0m`, `30deg`; bare numbers are degrees and
 * metres.
 */

import type { OrbitPosition } from './api.ts';

/** Degrees; null for what is no angle. */
export function parseAngle(text: string): number | null {
  const match = /^\s*(-?[\d.]+(?:e-?\d+)?)(deg|rad)?\s*$/i.exec(text);
  if (!match) return null;
  const value = Number(match[1]) * (match[2]?.toLowerCase() === 'rad' ? 180 / Math.PI : 1);
  return Number.isFinite(value) ? value : null;
}

/** A vertical field of view, degrees; undefined for what is none between 1 and 170. */
export function fieldOfView(text: string): number | undefined {
  const angle = parseAngle(text);
  return angle !== null && angle >= 1 && angle <= 170 ? angle : undefined;
}

/** Metres; null for what is no length. */
export function parseLength(text: string): number | null {
  const match = /^\s*(-?[\d.]+(?:e-?\d+)?)(m|cm|mm)?\s*$/i.exec(text);
  if (!match) return null;
  const unit = { m: 1, cm: 0.01, mm: 0.001 }[(match[2] ?? 'm').toLowerCase()] ?? 1;
  const value = Number(match[1]) * unit;
  return Number.isFinite(value) ? value : null;
}

/** Azimuth, inclination, distance. */
export function parseOrbit(text: string): OrbitPosition | null {
  const parts = text.trim().split(/\s+/);
  if (parts.length !== 3) return null;
  const [theta, phi, radius] = [parseAngle(parts[0]), parseAngle(parts[1]), parseLength(parts[2])];
  return theta === null || phi === null || radius === null || radius <= 0 ? null : { theta, phi, radius };
}

/** Three lengths. */
export function parseVector(text: string): [number, number, number] | null {
  const parts = text.trim().split(/\s+/).map(parseLength);
  return parts.length === 3 && parts.every((v) => v !== null) ? (parts as [number, number, number]) : null;
}

/** A word of a list. */
export function oneOf<T extends string>(known: readonly T[], value: string | null, otherwise: T): T {
  return known.find((item) => item === value) ?? otherwise;
}

/** A number above zero. */
export function positive(text: string | null, otherwise: number): number {
  const value = Number(text);
  return text !== null && Number.isFinite(value) && value > 0 ? value : otherwise;
}
