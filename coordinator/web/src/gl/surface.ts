/**
 * One baked surface on the GPU: its meshes, the textures of the scheme that it is drawn with, and what else views ask for (the mean for
 * "diffuse only", raw radiance for the error map).
 */

import {
  type DataArrayTexture, type DataTexture, Group, type IUniform, OneFactor, OneMinusSrcAlphaFactor, type RawShaderMaterial, type Texture, Vector2,
  type WebGLRenderer, ZeroFactor,
} from 'three';
import type { Vec3 } from '../format/bytes.ts';
import type { ExpandPool } from '../field/expand-pool.ts';
import { type FieldSurface, type LightField, PackageSource, fieldDirections } from '../field/light-field.ts';
import { type ArrayLayout, type GpuLimits, arrayBytes, arrayLayout } from '../field/layout.ts';
import type { Block } from '../field/decode.ts';
import type { Costs } from '../field/budget.ts';
import type { Scheme } from '../viewer/api.ts';
import type { ChannelTextures } from './channels.ts';
import { type CoverUniforms, type SharedUniforms, type SurfaceUniforms, arrayMaterial, meanMaterial, streamedMaterial } from './material.ts';
import { type SurfaceMesh, setMaterial, sortMesh, surfaceMeshes } from './meshes.ts';
import { writeRaw } from './raw.ts';
import { type Held, meanTexture, sampleTexture, streamBytes, streamTextures, writeLayers, writeMean } from './textures.ts';

/** Bytes of a block once expanded: a few frames' worth of upload. */
const BLOCK_BYTES = 4 << 20;
/** What a surface can be drawn as. */
export type Look = 'shown' | 'mean' | 'raw';

interface Drawable {
  scheme: Scheme;
  bytes: number;
  textures: Texture[];
  material(hardware: boolean, cover: CoverUniforms | null): RawShaderMaterial;
}

export class SurfaceView {
  readonly group = new Group();
  readonly surface: FieldSurface;
  private readonly field: LightField;
  private readonly limits: GpuLimits;
  private readonly base: Record<string, IUniform>;
  private readonly meshes: SurfaceMesh[];
  private readonly looks: Partial<Record<Look, Drawable>> = {};
  private samples: { held: Held<DataArrayTexture>; layout: ArrayLayout } | null = null;
  private mean: Held<DataTexture> | null = null;
  /** No light anywhere. */
  private readonly nothing = meanTexture(1, 1).texture;
  /** Of each mesh, before anything is laid out: the draft alone. */
  private readonly empty: RawShaderMaterial[];
  /** By look, filter and mesh; made when first drawn. */
  private readonly materials = new Map<string, RawShaderMaterial>();
  /** Counts layouts: work that was begun for textures that are gone writes nothing. */
  private generation = 0;
  private rawGeneration = 0;
  private rawReady = false;
  private look: Look = 'shown';
  private hardware = true;

  /** `depthOnly` is the material of the pre-pass of what covers all, one for all surfaces. */
  constructor(field: LightField, surface: FieldSurface, shared: SharedUniforms, channels: ChannelTextures, depthOnly: RawShaderMaterial, limits: GpuLimits) {
    this.field = field;
    this.surface = surface;
    this.limits = limits;
    const own: SurfaceUniforms = {
      lfSize: { value: new Vector2(surface.plan.width, surface.plan.height) },
      lfGrid: { value: new Vector2(field.grid.nTheta, field.grid.nPhi) },
      lfThetaFastest: { value: surface.walk === 'theta' ? 1 : 0 },
    };
    this.base = { ...shared, ...own };
    this.group.name = surface.name;
    this.meshes = surfaceMeshes(surface, this.group, channels, depthOnly, (cover) => meanMaterial(this.base, this.nothing, false, cover));
    this.empty = this.meshes.map(({ meshes }) => meshes[0].material);
  }

  /** Whether what lies behind shows through some of it. */
  get blended(): boolean {
    return this.meshes.some(({ cover }) => cover?.blended);
  }

  /** Orders what is blended for an eye in the object's space. */
  sort(eye: Vec3): void {
    this.meshes.forEach((it) => sortMesh(it, this.surface.geometry.positions, eye));
  }

  /** What each scheme would cost. */
  costs(): Costs {
    const { width, height } = this.surface.plan;
    const layout = this.layout();
    const mean = width * height * 8;
    const linear = this.field.container.plan.settings.raw === 'f32';
    const fitsMean = width <= this.limits.maxTextureSize && height <= this.limits.maxTextureSize;
    return {
      mean: fitsMean ? mean : null,
      expanded: layout && arrayBytes(layout, 4) + mean,
      streamed: this.surface.source instanceof PackageSource ? streamBytes(this.surface.source.coded, this.limits) : null,
      raw: layout && this.field.loadRaw ? arrayBytes(layout, linear ? 8 : 4) : null,
    };
  }

  get scheme(): Scheme | null {
    return this.looks.shown?.scheme ?? null;
  }

  /** Bytes of its textures. */
  get bytes(): number {
    return [...new Set(Object.values(this.looks))].reduce((sum, look) => sum + look.bytes, 0);
  }

  /**
   * Lays out textures for a scheme, empty: what is not there yet is drawn as a draft. Streams are complete at once. null: a surface that
   * this GPU cannot hold in any way stays a draft.
   */
  begin(renderer: WebGLRenderer, scheme: Scheme | null): void {
    this.drop();
    if (scheme === null) return;
    if (scheme === 'streamed' && this.surface.source instanceof PackageSource) {
      const streams = streamTextures(renderer, this.surface.source.coded, this.limits);
      const textures = [streams.starts, streams.steps, streams.colours, ...(streams.map ? [streams.map] : [])];
      this.looks.shown = { scheme, bytes: streams.bytes, textures, material: (_, cover) => streamedMaterial(this.base, streams, cover) };
    } else if (scheme === 'expanded' || scheme === 'raw') {
      this.looks.shown = this.beginSamples(scheme);
      if (scheme === 'expanded' && this.costs().mean !== null) this.beginMean();
    } else {
      this.looks.shown = this.beginMean();
    }
    this.apply();
  }

  /** Fills what {@link begin} laid out; `each` is called after every block, so that pictures grow. */
  async fill(renderer: WebGLRenderer, pool: ExpandPool, each: () => void): Promise<void> {
    if (this.scheme === 'raw') await this.fillRaw(renderer, each);
    else if (this.scheme !== 'streamed' && this.scheme !== null) await this.fillBlocks(renderer, pool, this.surface.source.blocks(BLOCK_BYTES), each);
  }

  /** Decodes and writes blocks: of the whole surface, or of a tile that has just arrived. */
  async fillBlocks(renderer: WebGLRenderer, pool: ExpandPool, blocks: Iterable<Block>, each: () => void): Promise<void> {
    const { samples, mean, generation } = this;
    const write = async (block: Block) => {
      const expanded = await pool.expand(block, this.field.grid, this.surface.walk, samples !== null);
      if (generation !== this.generation) return;
      if (samples && expanded.layers) {
        const layers = { ...expanded, data: expanded.layers };
        writeLayers(renderer, samples.held.texture, samples.layout, this.surface.plan, fieldDirections(this.field), layers);
      }
      if (mean) writeMean(renderer, mean.texture, expanded);
      each();
    };
    const work: Promise<void>[] = [];
    try {
      for (const block of blocks) {
        work.push(write(block));
        if (work.length > pool.parallel) await work.shift();
      }
    } finally {
      // Also where one of them has failed: none is left without anybody who waits for it.
      await Promise.all(work);
    }
  }

  /** Makes sure that the mean can be drawn. */
  async ensureMean(renderer: WebGLRenderer, pool: ExpandPool): Promise<void> {
    if (this.looks.mean || this.costs().mean === null) return;
    this.beginMean();
    const { mean, generation } = this;
    for (const block of this.surface.source.blocks(BLOCK_BYTES)) {
      const expanded = await pool.expand(block, this.field.grid, this.surface.walk, false);
      if (generation !== this.generation || !mean) return;
      writeMean(renderer, mean.texture, expanded);
    }
  }

  /** Makes sure that raw radiance can be drawn. Throws where the package kept none, or the GPU cannot hold it. */
  async ensureRaw(renderer: WebGLRenderer): Promise<void> {
    if (this.looks.raw) return;
    if (this.scheme === 'raw') {
      this.looks.raw = this.looks.shown;
      return;
    }
    if (!this.costs().raw) throw new Error(`${this.surface.name}: this GPU's textures cannot hold its raw radiance`);
    const held = this.makeSamples('raw');
    // Known from the start, so that a layout that comes in between lets go of it.
    this.looks.raw = held.drawable;
    this.rawReady = false;
    this.rawReady = await this.writeRaw(renderer, held, () => {});
  }

  /** Whether all of the raw radiance is there. */
  get hasRaw(): boolean {
    return this.looks.raw !== undefined && (this.rawReady || this.looks.raw === this.looks.shown);
  }

  /** Lets go of raw radiance, unless it is what is shown. */
  releaseRaw(): void {
    const { raw } = this.looks;
    if (!raw || raw === this.looks.shown) return;
    delete this.looks.raw;
    raw.textures.forEach((texture) => texture.dispose());
    for (const key of [...this.materials.keys()].filter((k) => k.startsWith('raw '))) {
      this.materials.get(key)?.dispose();
      this.materials.delete(key);
    }
    // Bands that are still being written belong to it.
    this.rawGeneration++;
    this.apply();
  }

  /** Chooses what is drawn and how texels are interpolated. */
  show(look: Look, hardware: boolean): void {
    this.look = look;
    this.hardware = hardware;
    this.apply();
  }

  /**
   * Says what the shaders write, `lfOutput` in `lf_surface.frag`. The alpha of radiance is the chart behind, which light in front does not
   * change; what is looked up is one place a pixel, and what is blended none.
   */
  setOutput(output: number): void {
    for (const { meshes, cover } of this.meshes) {
      if (!cover?.blended) continue;
      meshes.forEach((mesh) => (mesh.visible = output !== 2));
      const { material } = meshes[0];
      material.blendSrcAlpha = output === 1 ? ZeroFactor : OneFactor;
      material.blendDstAlpha = output === 1 ? OneFactor : OneMinusSrcAlphaFactor;
    }
  }

  dispose(): void {
    this.drop();
    this.empty.forEach((material) => material.dispose());
    this.nothing.dispose();
    for (const { meshes, depth, cover } of this.meshes) {
      meshes[0].geometry.dispose();
      // The pre-pass of what covers all is another's.
      if (cover) depth?.material.dispose();
    }
  }

  private apply(): void {
    const look = this.looks[this.look] ? this.look : 'shown';
    const drawable = this.looks[look];
    if (!drawable) return;
    this.meshes.forEach((it, k) => {
      const key = `${look} ${this.hardware} ${k}`;
      let material = this.materials.get(key);
      if (!material) this.materials.set(key, (material = drawable.material(this.hardware, it.uniforms)));
      setMaterial(it, material);
    });
  }

  private layout(): ArrayLayout | null {
    return arrayLayout(this.surface.plan.width, this.surface.plan.height, fieldDirections(this.field), this.limits);
  }

  private makeSamples(scheme: 'raw' | 'expanded'): { held: Held<DataArrayTexture>; layout: ArrayLayout; drawable: Drawable } {
    const layout = this.layout();
    if (!layout) throw new Error(`${this.surface.name}: its samples do not fit this GPU's textures`);
    const linear = scheme === 'raw' && this.field.container.plan.settings.raw === 'f32';
    const held = sampleTexture(layout, linear);
    const make: Drawable['material'] = (hardware, cover) => arrayMaterial(scheme, this.base, held.texture, layout, hardware, cover);
    return { held, layout, drawable: { scheme, bytes: held.bytes, textures: [held.texture], material: make } };
  }

  private beginSamples(scheme: 'raw' | 'expanded'): Drawable {
    const { held, layout, drawable } = this.makeSamples(scheme);
    this.samples = { held, layout };
    return drawable;
  }

  private beginMean(): Drawable {
    const held = meanTexture(this.surface.plan.width, this.surface.plan.height);
    this.mean = held;
    const make: Drawable['material'] = (hardware, cover) => meanMaterial(this.base, held.texture, hardware, cover);
    this.looks.mean = { scheme: 'mean', bytes: held.bytes, textures: [held.texture], material: make };
    return this.looks.mean;
  }

  private async fillRaw(renderer: WebGLRenderer, each: () => void): Promise<void> {
    const { samples } = this;
    if (samples) await this.writeRaw(renderer, samples, each);
  }

  /** Whether it came to its end: not where the texture was let go of meanwhile. */
  private writeRaw(renderer: WebGLRenderer, { held, layout }: { held: Held<DataArrayTexture>; layout: ArrayLayout }, each: () => void): Promise<boolean> {
    const { generation, rawGeneration } = this;
    const wanted = () => generation === this.generation && rawGeneration === this.rawGeneration;
    return writeRaw(this.field, this.surface, BLOCK_BYTES, wanted, (layers) => {
      writeLayers(renderer, held.texture, layout, this.surface.plan, fieldDirections(this.field), layers);
      each();
    });
  }

  private drop(): void {
    new Set(Object.values(this.looks).flatMap((look) => look.textures)).forEach((texture) => texture.dispose());
    for (const look of Object.keys(this.looks)) delete this.looks[look as Look];
    this.meshes.forEach((it, k) => setMaterial(it, this.empty[k]));
    this.materials.forEach((material) => material.dispose());
    this.materials.clear();
    this.samples = null;
    this.mean = null;
    this.generation++;
  }
}
