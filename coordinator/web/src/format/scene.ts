/**
 * The canonical scene within `scene.kiln` (docs/formats.md), as far as a viewer needs it: geometry with its parts, what shows through,
 * lights for drafts, cameras. What only decides the baked light (shadow rules, images, normal maps) is read over.
 *
 * Materials come behind the surfaces whose coordinates they may need: coordinate sets and vertex colours stay undecoded bytes until it is
 * known which are wanted, which is few.
 */

import { ByteReader } from './bytes.ts';
import { type Environment, readEnvironment } from './environment.ts';
import { type Light, type Projector, type SceneCamera, readCamera, readLight, readProjector, readShadowMap } from './light.ts';
import { type Material, type TextureRef, mayBeClear, readMaterial } from './material.ts';
import { type ChannelName, type SceneTexture, channelsOf, leastOf, meanOf, readImage } from './texture.ts';

const SCENE_VERSION = 3;

/** A run of triangles of one material. */
export interface Part {
  name: string;
  /** Index into the scene's materials. */
  material: number;
  /** The first triangle behind it. */
  end: number;
}

export interface SceneSurface {
  name: string;
  fileStem: string;
  /** Of the back of a two-sided surface: index of its front. */
  backOf: number | null;
  parts: Part[];
  /** Three vertex indices per triangle. */
  corners: Uint32Array;
  /** Three indices into the scene's normals per triangle; empty where the surface is flat in each triangle. */
  normals: Uint32Array;
  /** Author's texture coordinates by set, six per triangle, (0, 0) where there are none: the sets that decide what shows through. */
  uvSets: Map<number, Float32Array>;
  /**
   * Linear vertex colour and opacity of each corner, four numbers; null where there are none, or they decide nothing that shows through.
   */
  colours: Float32Array | null;
}

export interface Scene {
  /** x, y, z in metres. */
  positions: Float32Array;
  /** x, y, z of unit vectors. */
  normals: Float32Array;
  surfaces: SceneSurface[];
  materials: Material[];
  textures: SceneTexture[];
  lights: Light[];
  environment: Environment | null;
  projectors: Projector[];
  cameras: SceneCamera[];
}

/** A texture that decides what shows through, and its channels. */
export interface CoverTexture {
  ref: TextureRef;
  channel: ChannelName;
}

/** The textures that decide what shows through a material. */
export interface CoverTextures {
  opacity: CoverTexture | null;
  transmission: CoverTexture | null;
  /** Green: roughness, blue: metalness. */
  roughness: CoverTexture | null;
  /** Of clear glass. */
  tint: CoverTexture | null;
}

/** `textures` tell how rough those are that vary it. */
export function coverTextures(material: Material, textures: readonly SceneTexture[]): CoverTextures {
  const { opacity, transmission, layers } = material;
  const of = (ref: TextureRef | null | undefined, channel: ChannelName): CoverTexture | null => (ref ? { ref, channel } : null);
  const clear = mayBeClear(material, textures);
  return {
    opacity: opacity.mode === 'opaque' ? null : of(opacity.texture, 'alpha'),
    transmission: clear ? of(transmission?.texture, 'red') : null,
    roughness: clear ? of(transmission?.metallicRoughness, 'colour') : null,
    tint: clear && layers.length === 1 && layers[0].mode === 'modulate' && layers[0].scale === 1 ? of(layers[0].texture, 'colour') : null,
  };
}

const coverList = (material: Material, textures: readonly SceneTexture[]): CoverTexture[] =>
  Object.values(coverTextures(material, textures)).filter((it) => it !== null);

/** A surface with what is decoded when its materials are known. */
interface Undecoded {
  surface: SceneSurface;
  /** The bytes of each coordinate set. */
  sets: ByteReader[];
  /** Three indices into the scene's colours per triangle. */
  colours: Uint32Array;
}

export function readScene(r: ByteReader): Scene {
  const version = r.varint('scene version');
  if (version !== SCENE_VERSION) throw r.error(`scene version ${version}; this page reads version ${SCENE_VERSION}`);
  const positions = r.floats(r.length(12, 'positions') * 3, 'positions');
  const normals = r.floats(r.length(12, 'normals') * 3, 'normals');
  r.skip(r.length(16, 'tangents') * 16, 'tangents');
  const colours = r.floats(r.length(16, 'colours') * 4, 'colours');
  const undecoded = r.list(8, 'surfaces', () => readSurface(r));
  const materials = r.list(22, 'materials', () => readMaterial(r));
  const textures = readTextures(r, materials);
  const lights = r.list(90, 'lights', () => readLight(r));
  const environment = r.option(() => readEnvironment(r), 'environment');
  const projectors = r.list(66, 'projectors', () => readProjector(r));
  const cameras = r.list(42, 'cameras', () => readCamera(r));
  r.bool('strict shadows');
  r.bool('shadows outside');
  r.end();
  const surfaces = undecoded.map(({ surface }) => surface);
  const scene = { positions, normals, surfaces, materials, textures, lights, environment, projectors, cameras };
  check(r, scene);
  undecoded.forEach((it) => decode(r, it, scene, colours));
  return scene;
}

function readSurface(r: ByteReader): Undecoded {
  const [name, fileStem] = [r.text('surface name'), r.text('file stem')];
  const backOf = r.option(() => r.varint('front'), 'front');
  let end = 0;
  const parts = r.list(7, 'parts', () => readPart(r, (count) => (end += count)));
  const corners = new Uint32Array(r.length(4, 'triangles') * 3);
  for (let at = 0; at < corners.length; at += 3) {
    for (let c = 0; c < 3; c++) corners[at + c] = r.varint('corner');
    r.varint('polygon');
  }
  const sets = r.list(1, 'coordinate sets', () => readOver(r));
  const [normals, , colours] = [r.varints(3, 'normals'), r.varints(3, 'tangents'), r.varints(3, 'colours')];
  return { surface: { name, fileStem, backOf, parts, corners, normals, uvSets: new Map(), colours: null }, sets, colours };
}

function readPart(r: ByteReader, endOf: (triangles: number) => number): Part {
  const [name, material] = [r.text('part name'), r.varint('material')];
  const end = endOf(r.varint('triangles of a part'));
  r.bool('casts shadows');
  r.varints(1, 'receives shadows');
  r.varints(1, 'unlit by');
  r.list(12, 'shadow maps', () => {
    r.varint('light');
    readShadowMap(r);
  });
  return { name, material, end };
}

/** A coordinate set as bytes. */
function readOver(r: ByteReader): ByteReader {
  const count = r.length(1, 'texture coordinates');
  const from = r.position;
  for (let t = 0; t < count; t++) r.option(() => r.skip(24, 'texture coordinates'), 'texture coordinates');
  return new ByteReader(r.bytes.subarray(from, r.position), 'scene.kiln');
}

/** Which channels are wanted turns on how rough the rough ones are: what is clear nowhere needs neither its roughness nor its colours. */
function readTextures(r: ByteReader, materials: Material[]): SceneTexture[] {
  const images = r.list(6, 'textures', () => readImage(r));
  const rough = new Set(materials.map(({ transmission }) => transmission?.metallicRoughness?.texture));
  const textures = images.map((image, i): SceneTexture => {
    return { name: image.name, mean: meanOf(image), least: rough.has(i) ? leastOf(image) : null, channels: {} };
  });
  const wanted = new Map<number, Set<ChannelName>>();
  for (const { ref, channel } of materials.flatMap((material) => coverList(material, textures))) {
    wanted.set(ref.texture, (wanted.get(ref.texture) ?? new Set()).add(channel));
  }
  images.forEach((image, i) => (textures[i].channels = channelsOf(image, wanted.get(i) ?? new Set())));
  return textures;
}

/** Every index that is followed later must lead somewhere. */
function check(r: ByteReader, { positions, normals, surfaces, materials, textures, projectors }: Scene): void {
  const refs = materials.flatMap((m) => {
    const { specularTexture, reflectanceTexture } = m.transmission ?? {};
    const single = [m.emissionTexture, specularTexture, reflectanceTexture].filter((ref) => ref != null);
    return [...m.layers.map((l) => l.texture), ...coverList(m, textures).map(({ ref }) => ref), ...single];
  });
  for (const { texture, mapping } of refs) {
    if (texture >= textures.length) throw r.error(`a material has texture ${texture}; there are ${textures.length}`);
    if (mapping.from === 'projector' && mapping.index >= projectors.length) throw r.error(`a material has projector ${mapping.index}, which is missing`);
  }
  surfaces.forEach((surface, i) => {
    const { name, corners, parts, backOf } = surface;
    const within = (indices: Uint32Array, pool: Float32Array) => indices.every((index) => index * 3 < pool.length);
    if (!within(corners, positions)) throw r.error(`surface ${name} has a corner without position`);
    if (surface.normals.length > 0 && surface.normals.length !== corners.length) throw r.error(`surface ${name} has not a normal for each corner`);
    if (!within(surface.normals, normals)) throw r.error(`surface ${name} has a normal that is missing`);
    if ((parts.at(-1)?.end ?? 0) * 3 !== corners.length) throw r.error(`the parts of surface ${name} are not its triangles`);
    if (parts.some(({ material }) => material >= materials.length)) throw r.error(`surface ${name} has no material`);
    if (backOf !== null && (backOf === i || surfaces[backOf]?.corners.length !== corners.length)) throw r.error(`surface ${name} is the back of none`);
  });
}

/** Decodes the coordinate sets and vertex colours of a surface that decide what shows through it. */
function decode(r: ByteReader, { surface, sets, colours }: Undecoded, { materials, textures }: Scene, pool: Float32Array): void {
  const own = [...new Set(surface.parts.map((part) => materials[part.material]))];
  for (const { ref } of own.flatMap((material) => coverList(material, textures))) {
    const { from, index } = ref.mapping;
    if (from === 'uv' && sets[index] && !surface.uvSets.has(index)) surface.uvSets.set(index, coordinates(sets[index], surface.corners.length * 2));
  }
  const isClear = own.some((material) => mayBeClear(material, textures));
  if (colours.length === 0 || !(isClear || own.some(({ opacity }) => opacity.mode !== 'opaque'))) return;
  if (colours.length !== surface.corners.length || colours.some((c) => c * 4 >= pool.length)) {
    throw r.error(`surface ${surface.name} has a vertex colour that is missing`);
  }
  // Without glass, only their opacity counts.
  if (!isClear && colours.every((c) => pool[c * 4 + 3] === 1)) return;
  const of = new Float32Array(colours.length * 4);
  colours.forEach((c, corner) => of.set(pool.subarray(c * 4, c * 4 + 4), corner * 4));
  surface.colours = of;
}

function coordinates(set: ByteReader, count: number): Float32Array {
  const out = new Float32Array(count);
  for (let at = 0; set.left > 0; at += 6) {
    const corners = set.option(() => set.floats(6, 'texture coordinates'), 'texture coordinates');
    if (at + 6 > count) throw set.error('a coordinate set has more entries than triangles');
    if (corners) out.set(corners, at);
  }
  return out;
}

/** The part of a triangle. */
export const partOf = (surface: SceneSurface, triangle: number): Part | undefined => surface.parts.find(({ end }) => triangle < end);
