import { BufferAttribute, DataTexture } from 'three';
import { describe, expect, it } from 'vitest';
import type { Cover, LookUp, Sampled } from '../field/cover.ts';
import { LOOK_UPS, NOWHERE, lookUpAttributes, lookUpUniforms } from './look-ups.ts';
import { depthProgram, shaderVariants, surfaceProgram } from './shaders.ts';

const sampled = (texture: number, over: Partial<Sampled> = {}): Sampled => ({
  texture, channel: 'colour', wrap: ['repeat', 'repeat'], nearest: false, transform: [texture, 0, 0, 0, 1, 0], projected: false, ...over,
});

describe('what is looked up', () => {
  it('has the names that the shaders have', () => {
    const { vertex, fragment } = surfaceProgram('expanded');
    for (const { attribute, sampler, move } of Object.values(LOOK_UPS)) {
      const varying = `v${attribute[0].toUpperCase()}${attribute.slice(1)}`;
      expect(vertex).toContain(`in vec3 ${attribute};`);
      expect(vertex).toContain(`${varying} = ${attribute};`);
      expect(fragment).toContain(`uniform sampler2D ${sampler};`);
      expect(fragment).toContain(`uniform vec3 ${move}[ 2 ];`);
      // Each with its own, and with its own bit of `lfProjected`.
      const at = Object.values(LOOK_UPS).findIndex((it) => it.attribute === attribute);
      expect(fragment).toContain(`lfFound( ${sampler}, ${varying}, ${move}, lfProjected.${'xyzw'[at]} )`);
      expect(NOWHERE[attribute]).toEqual([0, 0, 0]);
    }
  });

  it('reaches them as attributes and uniforms, each its own', () => {
    const places = new Float32Array(9);
    expect(lookUpAttributes({ roughness: places })).toEqual({ roughnessAt: new BufferAttribute(places, 3) });
    const textures: Cover['textures'] = { opacity: sampled(2), transmission: null, roughness: sampled(3, { projected: true }), tint: null };
    const found = new Map<LookUp | null, DataTexture>([[null, new DataTexture()], ['opacity', new DataTexture()], ['roughness', new DataTexture()]]);
    const uniforms = lookUpUniforms(textures, (it) => found.get(it && (it.texture === 2 ? 'opacity' : 'roughness'))!);
    expect(uniforms.lfProjected.value).toEqual([0, 0, 1, 0]);
    expect([uniforms.lfAlpha.value, uniforms.lfPassing.value, uniforms.lfRoughness.value]).toEqual([found.get('opacity'), found.get(null), found.get('roughness')]);
    expect([uniforms.lfAlphaMove.value[0].x, uniforms.lfPassingMove.value[0].x, uniforms.lfRoughnessMove.value[0].x]).toEqual([2, 1, 3]);
  });

  it('is no more in the pre-pass than decides where holes are', () => {
    const names = shaderVariants().map(({ name }) => name);
    expect(names.filter((name) => name.startsWith('depth'))).toEqual(['depth', 'depth', 'depth-mask', 'depth-mask']);
    expect(names.filter((name) => name.startsWith('mean-exact'))).toHaveLength(6);
    const outside = (source: string) => source.replace(/#if LF_COVER == 2[\s\S]*?#endif/g, '');
    for (const source of [depthProgram.vertex, depthProgram.fragment].map(outside)) {
      for (const name of ['Passing', 'Roughness', 'Tint']) expect(source).not.toContain(name);
    }
  });
});
