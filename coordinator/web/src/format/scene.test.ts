import { describe, expect, it } from 'vitest';
import { ByteWriter } from '../testing.ts';
import { ByteReader, FormatError } from './bytes.ts';
import { partOf, readScene } from './scene.ts';

const IDENTITY = [1, 0, 0, 0, 1, 0];

/** A look-up of a texture over coordinate set 1, doubled, mirrored along u and clamped along v, nearest. */
const textureRef = (w: ByteWriter, texture: number) => w.varint(texture).varint(0, 1).f32(2, 0, 0, 0, 2, 0).varint(1, 2).u8(1);

type Change = 'version' | 'corner' | 'material' | 'end' | 'front' | 'texture' | 'roughness' | 'green' | 'alpha';

/**
 * A scene with every kind of thing in it: docs/formats.md, byte by byte. `change` may replace a piece: with a `roughness` the thin wall has
 * a texture of it, whose texels are `green`.
 */
function sceneBytes(change: Partial<Record<Change, number>> = {}): Uint8Array {
  const w = new ByteWriter();
  w.varint(change.version ?? 3);
  w.varint(4).f32(0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0);
  w.varint(1).f32(0, 0, 1);
  w.varint(1).f32(1, 0, 0, -1);
  w.varint(2).f32(1, 1, 1, 1, 1, 1, 1, change.alpha ?? 0.5);
  // A surface of two parts with two coordinate sets, normals, tangents and colours; then its back, flat.
  w.varint(2);
  w.text('leaf').text('leaf').u8(0);
  w.varint(2);
  w.text('stem').varint(0, 1).u8(1).varint(0, 0, 0);
  w.text('blade').varint(change.material ?? 1, change.end ?? 1).u8(0).varint(1, 0).varint(2, 0, 1);
  w.varint(1).varint(0).varint(2, 512).f32(1, 2).varint(0);
  w.varint(2).varint(0, 1, 2, 300).varint(0, 2, change.corner ?? 3, 301);
  w.varint(2);
  w.varint(2).u8(0).u8(0);
  w.varint(2).u8(0).u8(1).f32(0.1, 0.2, 0.3, 0.4, 0.5, 0.6);
  w.varint(2).varint(0, 0, 0, 0, 0, 0);
  w.varint(2).varint(0, 0, 0, 0, 0, 0);
  w.varint(2).varint(0, 0, 0, 0, 1, 0);
  w.text('leaf~back').text('leaf~back').u8(1).varint(change.front ?? 0);
  w.varint(1).text('leaf~back').varint(0, 2).u8(1).varint(0, 0, 0);
  w.varint(2).varint(0, 2, 1, 300).varint(0, 3, 2, 301);
  w.varint(0, 0, 0, 0);
  // A mirror of MTL's kind, and a mask with a thin wall behind it that a texture varies.
  w.varint(3);
  w.text('bark').varint(1).f32(0.5, 0.4, 0.3);
  w.varint(1).varint(0).varint(0, 0).f32(...IDENTITY).varint(0, 0).u8(0).varint(0).f32(2);
  w.f32(0.1, 0.1, 0.1).u8(0).varint(1).f32(0.25).f32(7, 8, 9).u8(0).varint(0).f32(1).u8(0).u8(0);
  w.text('skin').varint(2).f32(1, 1, 1).varint(0).f32(0.25, change.roughness ?? 0.01);
  if (change.roughness === undefined) w.u8(0);
  else textureRef(w.u8(1), 1);
  w.f32(2, 0.5).u8(0).f32(1, 1, 1).u8(0).f32(0.8).u8(1);
  textureRef(w, 1);
  w.f32(0, 0, 0).u8(0).varint(1).f32(0.3, 0.9).u8(1);
  textureRef(w, change.texture ?? 1);
  w.u8(1);
  textureRef(w, 0).f32(0.7);
  w.text('lamp').varint(0).f32(1, 2, 3).u8(0).varint(2).f32(0.5).u8(0).u8(0);
  w.varint(2);
  w.text('a.png').varint(1, 1).varint(0).u8(0).varint(3).u8(255, 0, 0);
  const green = change.green ?? 0;
  w.text('b.png').varint(2, 1).varint(1).u8(1).varint(8).u8(0, 255, 0, 255, 255, green, 0, 51);
  w.varint(3);
  const rest = (name: string) => w.f32(0, 0, 0).u8(1).f32(1).f32(...Array(13).fill(0)).u8(15).u8(0).u8(0) && name;
  w.text('bulb').varint(0).f32(1, 2, 3).f32(4, 5, 6).varint(0).u8(1).f32(10);
  rest('bulb');
  w.text('sun').varint(2).f32(0, -1, 0).f32(1, 1, 1).varint(0).u8(0);
  rest('sun');
  w.text('beam').varint(1).f32(0, 9, 0, 0, -1, 0).f32(0.7, 0.2).varint(1).f32(1, 1, 1).varint(1).f32(1, 0, 0.5, 100);
  w.f32(0, 0, 0).u8(1).f32(1).f32(...Array(13).fill(0)).u8(0).u8(1).varint(0, 1024).f32(1, 4).varint(2).u8(1);
  textureRef(w, 0);
  w.u8(1).text('sky').varint(2, 1).varint(2).f32(1, 2, 3, 3, 2, 1).f32(0.5).f32(10);
  w.varint(1).text('slide').u8(1).varint(0).f32(...Array.from({ length: 16 }, (_, i) => i));
  w.varint(2);
  w.text('Door').f32(0, 1, 2, 0, 0, -1, 0, 1, 0).varint(0).f32(0.8).u8(1);
  w.text('Plan').f32(0, 9, 0, 0, -1, 0, 0, 0, -1).varint(1).f32(3);
  return w.u8(1, 0).bytes;
}

const read = (bytes: Uint8Array) => readScene(new ByteReader(bytes, 'scene.kiln'));

describe('a scene', () => {
  it('is read whole', () => {
    const scene = read(sceneBytes());
    const [leaf, back] = scene.surfaces;
    expect([leaf.name, leaf.backOf, back.name, back.backOf]).toEqual(['leaf', null, 'leaf~back', 0]);
    expect([...leaf.corners, ...back.corners]).toEqual([0, 1, 2, 0, 2, 3, 0, 2, 1, 0, 3, 2]);
    expect(leaf.parts).toEqual([{ name: 'stem', material: 0, end: 1 }, { name: 'blade', material: 1, end: 2 }]);
    expect([partOf(leaf, 0)?.name, partOf(leaf, 1)?.name, partOf(leaf, 2)]).toEqual(['stem', 'blade', undefined]);
    expect([leaf.normals.length, back.normals.length]).toEqual([6, 0]);
    expect(scene.lights.map(({ name, shape, falloff }) => [name, shape.kind, falloff.kind])).toEqual([
      ['bulb', 'point', 'inverse-square'], ['sun', 'directional', 'inverse-square'], ['beam', 'spot', 'polynomial'],
    ]);
    expect(scene.lights[2].shape).toMatchObject({ cone: { profile: 'squared-cosine' } });
    expect(scene.lights[0].falloff).toEqual({ kind: 'inverse-square', range: 10 });
    scene.environment!.mean.forEach((v) => expect(v).toBeCloseTo(20));
    expect(scene.projectors[0].matrix[15]).toBe(15);
    expect(scene.cameras.map(({ name, lens }) => [name, lens.kind])).toEqual([['Door', 'perspective'], ['Plan', 'orthographic']]);
  });

  it('keeps of its images, coordinates and colours what decides what shows through', () => {
    const { materials, textures, surfaces } = read(sceneBytes());
    expect(materials.map(({ name, opacity }) => [name, opacity.mode])).toEqual([['bark', 'opaque'], ['skin', 'mask'], ['lamp', 'blend']]);
    expect(materials[0].layers[0]).toMatchObject({ mode: 'modulate', scale: 2 });
    expect(materials[1].transmission).toMatchObject({ metallic: 0.25, metallicRoughness: null, specular: 0.5 });
    materials[1].transmission!.reflectance.forEach((v) => expect(v).toBeCloseTo(1 / 9));
    expect(materials[1].opacity.texture).toMatchObject({ mapping: { from: 'uv', index: 1 }, wrap: ['mirror', 'clamp'], nearest: true });
    expect([textures[0].channels, [...textures[1].channels.alpha!.bytes], [...textures[1].channels.red!.bytes]]).toEqual([{}, [255, 51], [0, 255]]);
    expect(textures[0].mean).toEqual({ colour: [1, 0, 0], alpha: 1 });
    expect([...surfaces[0].uvSets.keys()]).toEqual([1]);
    [...surfaces[0].uvSets.get(1)!].forEach((v, i) => expect(v).toBeCloseTo(i < 6 ? 0 : (i - 5) / 10));
    expect(surfaces[0].colours!.filter((_, i) => i % 4 === 3)).toEqual(Float32Array.of(1, 1, 1, 1, 0.5, 1));
    expect([surfaces[1].uvSets.size, surfaces[1].colours]).toEqual([0, null]);
  });

  it('keeps nothing of glass that its texture leaves rough all over', () => {
    const kept = (change: Parameters<typeof sceneBytes>[0]) => {
      const { textures, surfaces } = read(sceneBytes(change));
      return [textures[1].least, Object.keys(textures[1].channels).sort(), surfaces[0].colours !== null];
    };
    expect(kept({ roughness: 0.5, green: 0 })).toEqual([[0, 0, 0], ['alpha', 'colour', 'red'], true]);
    expect(kept({ roughness: 0.5, green: 51 })).toEqual([[0, 0.2, 0], ['alpha'], true]);
    // A mask has nothing of vertex colours that are opaque; glass has their tint.
    expect(kept({ roughness: 0.5, green: 51, alpha: 1 })).toEqual([[0, 0.2, 0], ['alpha'], false]);
    expect(kept({ alpha: 1 })).toEqual([null, ['alpha', 'red'], true]);
  });

  it('is refused with the fault named, wherever it is cut, and where an index leads nowhere', () => {
    const whole = sceneBytes();
    for (let length = 0; length < whole.length; length++) expect(() => read(whole.subarray(0, length)), `cut to ${length}`).toThrow('scene.kiln: ');
    expect(() => read(Uint8Array.of(...whole, 0))).toThrow('follow its end');
    expect(() => read(sceneBytes({ version: 2 }))).toThrow('scene version 2; this page reads version 3');
    expect(() => read(sceneBytes({ corner: 4 }))).toThrow('corner without position');
    expect(() => read(sceneBytes({ material: 9 }))).toThrow('no material');
    expect(() => read(sceneBytes({ end: 2 }))).toThrow('not its triangles');
    expect(() => read(sceneBytes({ front: 1 }))).toThrow('back of none');
    expect(() => read(sceneBytes({ texture: 2 }))).toThrow('texture 2');
  });

  it('is read or refused, never worse, whatever its bytes are', () => {
    const whole = sceneBytes();
    let state = 1;
    const random = (below: number) => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) % below;
    let refused = 0;
    for (let round = 0; round < 1000; round++) {
      const bytes = whole.slice();
      for (let k = random(3); k >= 0; k--) bytes[random(bytes.length)] = [random(256), 251, 253, 255][random(4)];
      try {
        read(bytes);
      } catch (error) {
        expect(error, String(error)).toBeInstanceOf(FormatError);
        refused++;
      }
    }
    expect(refused).toBeGreaterThan(200);
  });
});
