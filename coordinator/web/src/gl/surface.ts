/**
 * One baked surface on the GPU: its meshes (depth pre-pass and colour), the textures of the scheme that it is drawn with, and what else views
 * ask for (the mean for "diffuse only", raw radiance for the error map).
 */

import {
  BufferAttribute, BufferGeometry, type DataArrayTexture, type DataTexture, Group, type IUniform, Mesh, type RawShaderMaterial, type Texture,
  Vector2, Vector3, type WebGLRenderer,
} from 'three';
import type { ExpandPool } from '../field/expand-pool.ts';
import { type FieldSurface, type LightField, PackageSource, fieldDirections } from '../field/light-field.ts';
import { type ArrayLayout, type GpuLimits, arrayBytes, arrayLayout } from '../field/layout.ts';
import type { Block } from '../field/decode.ts';
import type { Costs } from '../field/budget.ts';
import type { Scheme } from '../viewer/api.ts';
import { type SharedUniforms, type SurfaceUniforms, arrayMaterial, meanMaterial, streamedMaterial } from './material.ts';
import { rawLayers } from './raw.ts';
import { type Held, meanTexture, sampleTexture, streamBytes, streamTextures, writeLayers, writeMean } from './textures.ts';

/** Bytes of a block once expanded: a few frames' worth of upload. */
const BLOCK_BYTES = 4 << 20;
/** Drawn before everything that is not of a light field, and every pre-pass before every colour pass. */
const FIRST = -1000;

/** What a surface can be drawn as. */
export type Look = 'shown' | 'mean' | 'raw';

interface Drawable {
  scheme: Scheme;
  bytes: number;
  textures: Texture[];
  material(hardware: boolean): RawShaderMaterial;
}

export class SurfaceView {
  readonly group = new Group();
  readonly surface: FieldSurface;
  private readonly field: LightField;
  private readonly limits: GpuLimits;
  private readonly base: Record<string, IUniform>;
  private readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  private readonly looks: Partial<Record<Look, Drawable>> = {};
  private samples: { held: Held<DataArrayTexture>; layout: ArrayLayout } | null = null;
  private mean: Held<DataTexture> | null = null;
  /** No light anywhere. */
  private readonly nothing = meanTexture(1, 1).texture;
  /** Before anything is laid out: the draft alone. */
  private readonly empty: RawShaderMaterial;
  /** By look and filter; made when first drawn. */
  private readonly materials = new Map<string, RawShaderMaterial>();
  /** Counts layouts: work that was begun for textures that are gone writes nothing. */
  private generation = 0;
  private rawGeneration = 0;
  private rawReady = false;
  private look: Look = 'shown';
  private hardware = true;

  /** `depthOnly` is the material of the pre-pass, one for all surfaces. */
  constructor(field: LightField, surface: FieldSurface, shared: SharedUniforms, depthOnly: RawShaderMaterial, limits: GpuLimits) {
    this.field = field;
    this.surface = surface;
    this.limits = limits;
    const material = field.container.scene.materials[field.container.scene.surfaces[surface.index].material];
    const own: SurfaceUniforms = {
      lfSize: { value: new Vector2(surface.plan.width, surface.plan.height) },
      lfGrid: { value: new Vector2(field.grid.nTheta, field.grid.nPhi) },
      lfThetaFastest: { value: surface.walk === 'theta' ? 1 : 0 },
      lfDiffuse: { value: new Vector3(...material.diffuse) },
      lfEmission: { value: new Vector3(...material.emission) },
    };
    this.base = { ...shared, ...own };
    const geometry = bufferGeometry(surface);
    const depth = new Mesh(geometry, depthOnly);
    depth.renderOrder = FIRST;
    this.empty = meanMaterial(this.base, this.nothing, false);
    this.mesh = new Mesh(geometry, this.empty);
    this.mesh.renderOrder = FIRST + 1;
    this.mesh.userData.surface = surface.index;
    this.group.name = surface.name;
    this.group.add(depth, this.mesh);
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

  /** Lays out textures for a scheme, empty: what is not there yet is drawn as a draft. Streams are complete at once. null: a surface that this GPU cannot
   * hold in any way stays a draft. */
  begin(renderer: WebGLRenderer, scheme: Scheme | null): void {
    this.drop();
    if (scheme === null) return;
    if (scheme === 'streamed' && this.surface.source instanceof PackageSource) {
      const streams = streamTextures(renderer, this.surface.source.coded, this.limits);
      const textures = [streams.starts, streams.steps, streams.colours, ...(streams.map ? [streams.map] : [])];
      this.looks.shown = { scheme, bytes: streams.bytes, textures, material: () => streamedMaterial(this.base, streams) };
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

  dispose(): void {
    this.drop();
    this.empty.dispose();
    this.nothing.dispose();
    this.mesh.geometry.dispose();
  }

  private apply(): void {
    const look = this.looks[this.look] ? this.look : 'shown';
    const drawable = this.looks[look];
    if (!drawable) return;
    const key = `${look} ${this.hardware}`;
    let material = this.materials.get(key);
    if (!material) this.materials.set(key, (material = drawable.material(this.hardware)));
    this.mesh.material = material;
  }

  private layout(): ArrayLayout | null {
    return arrayLayout(this.surface.plan.width, this.surface.plan.height, fieldDirections(this.field), this.limits);
  }

  private makeSamples(scheme: 'raw' | 'expanded'): { held: Held<DataArrayTexture>; layout: ArrayLayout; drawable: Drawable } {
    const layout = this.layout();
    if (!layout) throw new Error(`${this.surface.name}: its samples do not fit this GPU's textures`);
    const linear = scheme === 'raw' && this.field.container.plan.settings.raw === 'f32';
    const held = sampleTexture(layout, linear);
    const make = (hardware: boolean) => arrayMaterial(scheme, this.base, held.texture, layout, hardware);
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
    const make = (hardware: boolean) => meanMaterial(this.base, held.texture, hardware);
    this.looks.mean = { scheme: 'mean', bytes: held.bytes, textures: [held.texture], material: make };
    return this.looks.mean;
  }

  private async fillRaw(renderer: WebGLRenderer, each: () => void): Promise<void> {
    const { samples } = this;
    if (samples) await this.writeRaw(renderer, samples, each);
  }

  /** Whether it came to its end: not where the texture was let go of meanwhile. */
  private async writeRaw(renderer: WebGLRenderer, target: { held: Held<DataArrayTexture>; layout: ArrayLayout }, each: () => void): Promise<boolean> {
    if (!this.field.loadRaw) throw new Error('the package kept no raw radiance; bake with --raw u8 or --raw f32');
    const { generation, rawGeneration } = this;
    const file = await this.field.loadRaw(this.surface.index);
    const directions = fieldDirections(this.field);
    for (const layers of rawLayers(file, this.surface, directions, 2 ** this.field.exposureStops, BLOCK_BYTES)) {
      if (generation !== this.generation || rawGeneration !== this.rawGeneration) return false;
      writeLayers(renderer, target.held.texture, target.layout, this.surface.plan, directions, layers);
      each();
      // A breath between bands: the view must not freeze while hundreds of megabytes are sorted.
      await new Promise((resolve) => setTimeout(resolve));
    }
    return generation === this.generation && rawGeneration === this.rawGeneration;
  }

  private drop(): void {
    new Set(Object.values(this.looks).flatMap((look) => look.textures)).forEach((texture) => texture.dispose());
    for (const look of Object.keys(this.looks)) delete this.looks[look as Look];
    this.mesh.material = this.empty;
    this.materials.forEach((material) => material.dispose());
    this.materials.clear();
    this.samples = null;
    this.mean = null;
    this.generation++;
  }
}

function bufferGeometry({ geometry }: FieldSurface): BufferGeometry {
  const out = new BufferGeometry();
  out.setAttribute('position', new BufferAttribute(geometry.positions, 3));
  out.setAttribute('normal', new BufferAttribute(geometry.normals, 3));
  out.setAttribute('tangent', new BufferAttribute(geometry.tangents, 3));
  out.setAttribute('uv', new BufferAttribute(geometry.uvs, 2));
  out.setAttribute('chart', new BufferAttribute(geometry.charts, 1));
  out.computeBoundingSphere();
  return out;
}
