/** For unit tests: the golden package of `tests/golden`, and bytes written by hand. */

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

/** Writes what {@link ByteReader} reads. */
export class ByteWriter {
  private readonly out: number[] = [];

  u8(...bytes: number[]): this {
    this.out.push(...bytes);
    return this;
  }

  /** bincode's varint. */
  varint(...values: number[]): this {
    for (const v of values) {
      if (v < 251) this.out.push(v);
      else if (v < 65536) this.out.push(251, v & 255, v >> 8);
      else this.out.push(252, ...new Uint8Array(Uint32Array.of(v).buffer));
    }
    return this;
  }

  f32(...values: number[]): this {
    return this.u8(...new Uint8Array(Float32Array.from(values).buffer));
  }

  text(text: string): this {
    const bytes = new TextEncoder().encode(text);
    return this.varint(bytes.length).u8(...bytes);
  }

  get bytes(): Uint8Array {
    return Uint8Array.from(this.out);
  }
}
