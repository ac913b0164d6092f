/** The golden package of `tests/golden`, for unit tests. */

import { readFileSync } from 'node:fs';
import { LightFieldLoader, type PackageFiles } from './loader.ts';
import type { LightField } from './field/light-field.ts';

const GOLDEN = new URL('../../../tests/golden/', import.meta.url);

export const goldenText = (name: string): string => readFileSync(new URL(name, GOLDEN), 'utf8');
export const goldenBytes = (name: string): Uint8Array => new Uint8Array(readFileSync(new URL(name, GOLDEN)));

/** Every file of the golden room by its path; a fresh copy each time, so that tests may damage it. */
export function goldenFiles(): PackageFiles {
  const { files } = JSON.parse(goldenText('room/manifest.json')) as { files: { path: string }[] };
  return new Map(files.map(({ path }) => [path, goldenBytes(`room/${path}`)]));
}

export const goldenRoom = (): LightField => new LightFieldLoader().parse(goldenText('room/manifest.json'), goldenFiles());
