/**
 * three's loader for Kiln packages: give it the URL of a manifest.json, get the light field, ready to be made into an object.
 *
 * All files of the codec are fetched, six at a time, raw radiance only when something asks for it. Progress counts bytes as the manifest
 * states them.
 */

import { Loader, type LoadingManager } from 'three';
import { FormatError } from './format/bytes.ts';
import { type CodedFiles, openCoded } from './format/coded.ts';
import { parseContainer } from './format/container.ts';
import { type Manifest, parseManifest } from './format/manifest.ts';
import { type LightField, PackageSource, makeField } from './field/light-field.ts';
import { directionCount, parseGrid } from './field/grid.ts';

const AT_ONCE = 6;
const CODED = ['mtsp', 'mti', 'mtnc', 'mtm'] as const;

/** The files of a package by their path in it. */
export type PackageFiles = Map<string, Uint8Array>;

export class LightFieldLoader extends Loader<LightField, string> {
  private readonly loading = new Set<AbortController>();

  constructor(manager?: LoadingManager) {
    super(manager);
  }

  /** Loads the package of a manifest's URL. Progress events carry `loaded` and `total` bytes. */
  override load(url: string, onLoad: (field: LightField) => void, onProgress?: (event: ProgressEvent) => void, onError?: (error: unknown) => void): void {
    const absolute = new URL(url, new URL(this.path || '.', document.baseURI)).href;
    const controller = new AbortController();
    this.loading.add(controller);
    this.manager.itemStart(absolute);
    this.fetchPackage(absolute, controller.signal, onProgress)
      .then(onLoad)
      .catch((error: unknown) => {
        // One file that cannot be had stops the others.
        controller.abort();
        this.manager.itemError(absolute);
        if (onError) onError(error);
        else console.error(error);
      })
      .finally(() => {
        this.loading.delete(controller);
        this.manager.itemEnd(absolute);
      });
  }

  /** Stops what is being fetched; each `load` then ends with an AbortError. */
  override abort(): this {
    this.loading.forEach((controller) => controller.abort());
    return this;
  }

  /**
   * Makes a light field of the bytes of a package: `manifest.json` as text and its files. Throws where something is missing or damaged.
   * `loadRaw` fetches the bytes of a surface's .mtex when they are wanted.
   */
  parse(manifestText: string, files: PackageFiles, loadRaw: LightField['loadRaw'] = null): LightField {
    const manifest = parseManifest(manifestText);
    const file = (path: string) => {
      const bytes = files.get(path);
      if (!bytes) throw new FormatError(`${path} is missing from the package`);
      return bytes;
    };
    const container = parseContainer(file('scene.kiln'));
    const { surfaces } = container.scene;
    if (manifest.surfaces.length !== surfaces.length || manifest.surfaces.some((s, i) => s.file_stem !== surfaces[i].fileStem)) {
      throw new FormatError('manifest.json and scene.kiln do not belong together');
    }
    const coded = (index: number) => {
      const { file_stem: stem, grid, walk } = manifest.surfaces[index];
      const { width, height } = container.plan.surfaces[index];
      const bytes = Object.fromEntries(CODED.map((kind) => [kind, file(surfacePath(stem, kind))])) as unknown as CodedFiles;
      return openCoded(bytes, stem, { width, height, grid: parseGrid(grid), walk });
    };
    return makeField(container, manifest, (index, grid) => new PackageSource(coded(index), directionCount(grid)), loadRaw);
  }

  private async fetchPackage(url: string, signal: AbortSignal, onProgress?: (event: ProgressEvent) => void): Promise<LightField> {
    const text = new TextDecoder().decode(await this.fetchBytes(url, signal));
    const manifest = parseManifest(text);
    const names = new Set(['scene.kiln', ...manifest.surfaces.flatMap(({ file_stem: stem }) => CODED.map((kind) => surfacePath(stem, kind)))]);
    const wanted = manifest.files.filter(({ path }) => names.has(path));
    const total = wanted.reduce((sum, { bytes }) => sum + bytes, 0);
    let loaded = 0;
    const count = (bytes: number) => {
      loaded += bytes;
      if (!signal.aborted) onProgress?.(new ProgressEvent('progress', { lengthComputable: true, loaded: Math.min(loaded, total), total }));
    };
    const files: PackageFiles = new Map();
    const queue = [...wanted].sort((a, b) => b.bytes - a.bytes);
    const hand = async () => {
      for (let next = queue.shift(); next; next = queue.shift()) {
        signal.throwIfAborted();
        files.set(next.path, await this.fetchBytes(assetUrl(url, next.path), signal, next.bytes));
        count(next.bytes);
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, hand));
    return this.parse(text, files, rawLoader(manifest, (path) => this.fetchBytes(assetUrl(url, path))));
  }

  private async fetchBytes(address: string, signal?: AbortSignal, expected?: number): Promise<Uint8Array> {
    const url = this.manager.resolveURL(address);
    const credentials = this.withCredentials ? 'include' : 'same-origin';
    const response = await fetch(url, { headers: this.requestHeader, credentials, signal }).catch((error: unknown) => {
      if ((error as Error).name === 'AbortError') throw error;
      throw new Error(`${url} cannot be reached: ${(error as Error).message}`);
    });
    if (!response.ok) throw new Error(`${url} answered ${response.status} ${response.statusText}`);
    const bytes = new Uint8Array(await response.arrayBuffer());
    if (expected !== undefined && bytes.length !== expected) {
      throw new FormatError(`${url} has ${bytes.length} bytes; the manifest says ${expected}`);
    }
    return bytes;
  }
}

/** Where a surface's file lies. Stems are file names: a manifest from elsewhere leads nowhere but into its own folder. */
function surfacePath(stem: string, kind: string): string {
  if (/[/\\\0]|^\.{0,2}$/.test(stem)) throw new FormatError(`the manifest names the files of a surface ${JSON.stringify(stem)}, which is no file name`);
  return `surfaces/${stem}.${kind}`;
}

/** Paths of a package are relative to its manifest; each part may hold any character. */
const assetUrl = (manifest: string, path: string): string => new URL(path.split('/').map(encodeURIComponent).join('/'), manifest).href;

function rawLoader(manifest: Manifest, fetchFile: (path: string) => Promise<Uint8Array>): LightField['loadRaw'] {
  const paths = manifest.surfaces.map((s) => surfacePath(s.file_stem, 'mtex'));
  const kept = new Set(manifest.files.map((f) => f.path));
  return paths.every((path) => kept.has(path)) ? (surface) => fetchFile(paths[surface]) : null;
}
