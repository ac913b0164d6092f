/** `manifest.json` (docs/formats.md), as far as the viewer reads it. */

import { FormatError } from './bytes.ts';

const SCHEMA = 2;

export interface ManifestSurface {
  name: string;
  file_stem: string;
  /** `WIDTHxHEIGHT`. */
  size: string;
  covered: number;
  grid: string;
  codec: string;
  walk: 'phi' | 'theta';
  encoding: {
    kept_samples: number;
    colours: number;
    colour_bits: number;
    raw_bytes: number;
    coded_bytes: number;
    ratio: number;
    grew: boolean;
    errors: { average: number; average_differing: number; p99_9: number; max: number; differing: number };
  };
}

export interface Manifest {
  schema: number;
  scene: string;
  bake_version: number;
  settings: Record<string, unknown>;
  exposure: { stops: number; clipped_ppm: number };
  bounds: { low: [number, number, number]; high: [number, number, number] };
  totals: { texels: number; covered: number; raw_bytes: number; coded_bytes: number; ratio: number };
  surfaces: ManifestSurface[];
  files: { path: string; media_type: string; bytes: number; sha256: string }[];
}

/** Reads a manifest's text. Throws a {@link FormatError} where it is none of this version. */
export function parseManifest(text: string): Manifest {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch (error) {
    throw new FormatError(`manifest.json is not JSON (${(error as Error).message}); is the URL that of a package's manifest?`);
  }
  const manifest = json as Partial<Manifest> | null;
  if (manifest?.schema !== SCHEMA) {
    throw new FormatError(`manifest.json has schema ${String(manifest?.schema)}; this page reads schema ${SCHEMA}`);
  }
  if (!Array.isArray(manifest.surfaces) || !Array.isArray(manifest.files) || typeof manifest.exposure?.stops !== 'number') {
    throw new FormatError('manifest.json lacks surfaces, files or exposure');
  }
  const other = manifest.surfaces.find((s) => s.codec !== 'pwl');
  if (other) throw new FormatError(`surface ${other.name} has the codec ${other.codec}; this page reads pwl`);
  return manifest as Manifest;
}
