/** Materials of baked surfaces: one for each scheme, all with the uniforms that a whole light field shares. */

import {
  CustomBlending, type DataArrayTexture, type DataTexture, FrontSide, GLSL3, type IUniform, LessEqualDepth, OneFactor, OneMinusSrcAlphaFactor,
  RawShaderMaterial, Vector2, Vector3, Vector4,
} from 'three';
import type { Cover } from '../field/cover.ts';
import type { ArrayLayout } from '../field/layout.ts';
import type { Scheme } from '../viewer/api.ts';
import type { ChannelTextures } from './channels.ts';
import { NOWHERE, lookUpUniforms } from './look-ups.ts';
import { depthProgram, surfaceProgram } from './shaders.ts';
import type { StreamTextures } from './textures.ts';

/** Lights that the draft knows; `LF_DRAFT_LIGHTS` in `lf_draft.glsl`. */
export const DRAFT_LIGHTS = 16;

/** Uniforms of all surfaces of a field: one object each, so that a change reaches every material. */
export interface SharedUniforms {
  [name: string]: IUniform;
  lfOutput: IUniform<number>;
  lfExposure: IUniform<number>;
  lfTexelGrid: IUniform<number>;
  lfDraftExposure: IUniform<number>;
  lfLightCount: IUniform<number>;
  lfLightPlace: IUniform<Vector4[]>;
  lfLightAxis: IUniform<Vector4[]>;
  lfLightPower: IUniform<Vector4[]>;
  lfLightFall: IUniform<Vector3[]>;
  lfLightCone: IUniform<Vector2[]>;
  lfAmbient: IUniform<Vector3>;
  lfParts: IUniform<DataTexture>;
}

/** `parts` is the table of {@link partTable}. */
export function sharedUniforms(parts: DataTexture): SharedUniforms {
  const each = <T>(make: () => T): T[] => Array.from({ length: DRAFT_LIGHTS }, make);
  return {
    lfOutput: { value: 0 },
    lfExposure: { value: 1 },
    lfTexelGrid: { value: 0 },
    lfDraftExposure: { value: 1 },
    lfLightCount: { value: 0 },
    lfLightPlace: { value: each(() => new Vector4()) },
    lfLightAxis: { value: each(() => new Vector4()) },
    lfLightPower: { value: each(() => new Vector4()) },
    lfLightFall: { value: each(() => new Vector3()) },
    lfLightCone: { value: each(() => new Vector2()) },
    lfAmbient: { value: new Vector3() },
    lfParts: { value: parts },
  };
}

/** What a surface tells its materials, whatever the scheme. */
export interface SurfaceUniforms {
  [name: string]: IUniform;
  lfSize: IUniform<Vector2>;
  lfGrid: IUniform<Vector2>;
  lfThetaFastest: IUniform<number>;
}

/** How a mesh covers what lies behind it, for its materials; null where it covers all. */
export interface CoverUniforms {
  blended: boolean;
  /** Blended channel by channel: {@link lfChannel} says which. */
  tinted: boolean;
  uniforms: Record<string, IUniform>;
  lfChannel: IUniform<Vector3>;
}

export function coverUniforms({ textures, glass, cutoff, blended }: Cover, channels: ChannelTextures): CoverUniforms {
  const lfChannel = { value: new Vector3(1, 0, 0) };
  const uniforms = {
    ...lookUpUniforms(textures, (sampled) => channels.get(sampled)),
    lfCutoff: { value: cutoff ?? -1 },
    lfGlass: { value: glass ? new Vector3(glass.transmission, glass.roughness, glass.metallic) : new Vector3(0, 1, 1) },
    lfReflected: { value: glass ? new Vector2(glass.specular, glass.normal) : new Vector2() },
    lfChannel,
  };
  return { blended, tinted: glass?.tinted ?? false, uniforms, lfChannel };
}

function withDefaults(material: RawShaderMaterial): RawShaderMaterial {
  Object.assign(material.defaultAttributeValues, NOWHERE);
  return material;
}

const coverDefines = (cover: CoverUniforms | null): Record<string, number> => (cover ? { LF_COVER: cover.blended ? 2 : 1 } : {});

function material(
  scheme: Scheme, uniforms: Record<string, IUniform>, defines: Record<string, number>, cover: CoverUniforms | null,
): RawShaderMaterial {
  const { vertex, fragment } = surfaceProgram(scheme);
  const out = new RawShaderMaterial({
    name: `kiln-${scheme}`,
    glslVersion: GLSL3,
    vertexShader: vertex,
    fragmentShader: fragment,
    uniforms: { ...uniforms, ...cover?.uniforms },
    defines: { ...defines, ...coverDefines(cover) },
    side: FrontSide,
    // The pre-pass has written the depths; see `lf_depth.frag`.
    depthWrite: false,
    depthFunc: LessEqualDepth,
  });
  if (cover?.blended) {
    out.transparent = true;
    out.blending = CustomBlending;
    out.blendSrc = OneFactor;
    out.blendDst = OneMinusSrcAlphaFactor;
  }
  return withDefaults(out);
}

const filterDefines = (hardware: boolean): Record<string, number> => (hardware ? { LF_HW_FILTER: 1 } : {});

/** Schemes `raw` and `expanded`. */
export function arrayMaterial(
  scheme: 'raw' | 'expanded', base: Record<string, IUniform>, texture: DataArrayTexture, layout: ArrayLayout, hardware: boolean, cover: CoverUniforms | null,
): RawShaderMaterial {
  const own = { lfSamples: { value: texture }, lfCells: { value: new Vector2(layout.cellsX, layout.cellsY) } };
  return material(scheme, { ...base, ...own }, filterDefines(hardware), cover);
}

export function streamedMaterial(base: Record<string, IUniform>, textures: StreamTextures, cover: CoverUniforms | null): RawShaderMaterial {
  const own: Record<string, IUniform> = {
    lfStarts: { value: textures.starts },
    lfSteps: { value: textures.steps },
    lfColours: { value: textures.colours },
    lfLogRows: { value: new Vector3(...textures.logRows) },
  };
  if (textures.map) own.lfMap = { value: textures.map };
  return material('streamed', { ...base, ...own }, textures.map ? {} : { LF_DIRECT: 1 }, cover);
}

export const meanMaterial = (base: Record<string, IUniform>, texture: DataTexture, hardware: boolean, cover: CoverUniforms | null): RawShaderMaterial =>
  material('mean', { ...base, lfMean: { value: texture } }, filterDefines(hardware), cover);

/** The depth pre-pass. */
export const depthMaterial = (cover: CoverUniforms | null): RawShaderMaterial =>
  withDefaults(
    new RawShaderMaterial({
      name: 'kiln-depth',
      glslVersion: GLSL3,
      vertexShader: depthProgram.vertex,
      fragmentShader: depthProgram.fragment,
      uniforms: { ...cover?.uniforms },
      defines: coverDefines(cover),
      side: FrontSide,
      colorWrite: false,
    }),
  );
