/**
 * A light field as an object of a three.js scene: add it, call {@link LightFieldObject.prepare}, draw as always.
 *
 * The depth pre-pass is two meshes a surface with render orders, not a pass of its own: any renderer draws it, frustum culling works as for
 * every mesh, and a host scene needs no changes. It costs twice the draw calls; drawing light fields costs fragments, not draws. What is
 * blended is sorted for a camera by {@link LightFieldObject.sort}, before each frame: three asks objects for nothing between knowing the
 * camera and uploading their vertices.
 */

import { type Camera, Group, Vector3, type WebGLRenderer } from 'three';
import { ExpandPool } from '../field/expand-pool.ts';
import { fitBudget } from '../field/budget.ts';
import type { GpuLimits } from '../field/layout.ts';
import { type LightField, TileSource } from '../field/light-field.ts';
import { add, length, scale, sub } from '../field/frame.ts';
import { type TileSegment } from '../format/segment.ts';
import type { Scheme } from '../viewer/api.ts';
import { Background } from './background.ts';
import { ChannelTextures } from './channels.ts';
import { setLights } from './lamps.ts';
import { type SharedUniforms, depthMaterial, sharedUniforms } from './material.ts';
import { partTable } from './parts.ts';
import { type Look, SurfaceView } from './surface.ts';

export interface PrepareOptions {
  scheme: 'auto' | Exclude<Scheme, 'mean'>;
  /** Bytes of textures. */
  budget: number;
  /** Called when there is more to see. */
  changed: () => void;
}

export class LightFieldObject extends Group {
  readonly field: LightField;
  readonly uniforms: SharedUniforms;
  readonly surfaces: SurfaceView[];
  /** What lies behind the scene, hidden until somebody shows it: a host scene has a background of its own. null without an environment. */
  readonly background: Background | null;
  private readonly pool = new ExpandPool();
  private readonly renderer: WebGLRenderer;
  private readonly depthOnly = depthMaterial(null);
  private readonly channels: ChannelTextures;
  private layouts = 0;

  /** `renderer` is the one that draws it: textures belong to its context. */
  constructor(field: LightField, renderer: WebGLRenderer) {
    super();
    this.field = field;
    this.renderer = renderer;
    const limits = gpuLimits(renderer);
    const { low, high } = field.bounds;
    this.uniforms = sharedUniforms(partTable(field.container.scene));
    const guess = setLights(this.uniforms, field.container, { centre: scale(add(low, high), 0.5), radius: length(sub(high, low)) / 2 || 1 });
    this.uniforms.lfDraftExposure.value = field.container.plan.results ? 2 ** field.exposureStops : guess;
    this.channels = new ChannelTextures(field.container.scene, limits);
    this.surfaces = field.surfaces.map((surface) => new SurfaceView(field, surface, this.uniforms, this.channels, this.depthOnly, limits));
    this.add(...this.surfaces.map((view) => view.group));
    const { environment } = field.container.scene;
    this.background = environment && new Background(environment, this.uniforms);
    if (this.background) {
      this.background.visible = false;
      this.add(this.background);
    }
  }

  /** Bytes that {@link prepare} would take. */
  plannedBytes({ scheme, budget }: Pick<PrepareOptions, 'scheme' | 'budget'>): number {
    const costs = this.surfaces.map((view) => view.costs());
    const bytes = this.besideSamples;
    return fitBudget(costs, budget - bytes, scheme).reduce((sum, chosen, i) => sum + ((chosen && costs[i][chosen]) ?? 0), bytes);
  }

  /** Lays out and fills the textures. Resolves when all is on the GPU; what is not there yet is drawn as a draft. */
  async prepare({ scheme, budget, changed }: PrepareOptions): Promise<void> {
    this.channels.fit(budget);
    const schemes = fitBudget(this.surfaces.map((view) => view.costs()), budget - this.besideSamples, scheme);
    const layout = ++this.layouts;
    this.surfaces.forEach((view, i) => view.begin(this.renderer, schemes[i]));
    changed();
    for (const view of this.surfaces) {
      // Laid out anew meanwhile: whoever did so fills it.
      if (layout !== this.layouts) return;
      await view.fill(this.renderer, this.pool, changed);
    }
  }

  /** Adds tiles of a job that is being baked. */
  async addTiles(tiles: TileSegment[], changed: () => void): Promise<void> {
    const work = tiles.map((tile) => {
      const view = this.surfaces[tile.surface];
      const source = view?.surface.source;
      if (!(source instanceof TileSource)) throw new Error(`tile ${tile.tile} belongs to surface ${tile.surface}, which this job does not have`);
      return view.fillBlocks(this.renderer, this.pool, [source.add(tile)], changed);
    });
    await Promise.all(work);
  }

  /**
   * Makes a look drawable; it is drawn by {@link show}. Ends early where `wanted` says no more. Throws where raw radiance beside what is
   * shown would pass `budget` bytes.
   */
  async ensure(look: Look, budget: number, wanted: () => boolean): Promise<void> {
    if (look === 'raw') this.checkRaw(budget);
    for (const view of this.surfaces) {
      if (!wanted()) return;
      if (look === 'mean') await view.ensureMean(this.renderer, this.pool);
      if (look === 'raw') await view.ensureRaw(this.renderer);
    }
  }

  /** Lets go of raw radiance that was there for comparison. */
  releaseRaw(): void {
    this.surfaces.forEach((view) => view.releaseRaw());
  }

  private checkRaw(budget: number): void {
    const more = this.surfaces.reduce((sum, view) => sum + (view.scheme === 'raw' ? 0 : (view.costs().raw ?? 0)), 0);
    const mib = (bytes: number) => Math.ceil(bytes / 2 ** 20);
    const all = more + this.plannedBytes({ scheme: 'auto', budget });
    if (this.surfaces.some((view) => view.scheme !== 'raw') && all > budget) {
      throw new Error(
        `Raw radiance takes ${mib(more)} MiB beside what is shown; the memory budget is ${mib(budget)} MiB: ` +
          `set memory-budget to ${mib(all)} or more`,
      );
    }
  }

  show(look: Look, hardware: boolean): void {
    this.surfaces.forEach((view) => view.show(look, hardware));
  }

  /** Whether what lies behind shows through something. */
  get blended(): boolean {
    return this.surfaces.some((view) => view.blended);
  }

  /** Orders what is blended back to front for a camera whose matrices are up to date. */
  sort(camera: Camera): void {
    if (!this.blended) return;
    const eye = this.worldToLocal(new Vector3().setFromMatrixPosition(camera.matrixWorld)).toArray();
    this.surfaces.forEach((view) => view.sort(eye));
  }

  /** What the shaders write: see {@link SurfaceView.setOutput}. */
  setOutput(output: number): void {
    this.uniforms.lfOutput.value = output;
    this.surfaces.forEach((view) => view.setOutput(output));
  }

  /** Bytes of all textures. */
  get bytes(): number {
    return this.surfaces.reduce((sum, view) => sum + view.bytes, this.besideSamples);
  }

  private get besideSamples(): number {
    return this.channels.bytes + (this.background?.bytes ?? 0);
  }

  override dispose(): void {
    this.pool.dispose();
    this.surfaces.forEach((view) => view.dispose());
    this.depthOnly.dispose();
    this.channels.dispose();
    this.background?.dispose();
    this.uniforms.lfParts.value.dispose();
    super.dispose();
  }
}

/** What this context can hold. */
export function gpuLimits(renderer: WebGLRenderer): GpuLimits {
  const gl = renderer.getContext() as WebGL2RenderingContext;
  return {
    maxTextureSize: gl.getParameter(gl.MAX_TEXTURE_SIZE) as number,
    maxArrayLayers: gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS) as number,
  };
}
