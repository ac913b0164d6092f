/** Materials of baked surfaces: one for each scheme, all with the uniforms that a whole light field shares. */

import {
  type DataArrayTexture, type DataTexture, FrontSide, GLSL3, type IUniform, LessEqualDepth, RawShaderMaterial, Vector2, Vector3,
} from 'three';
import type { ArrayLayout } from '../field/layout.ts';
import type { Scheme } from '../viewer/api.ts';
import { depthProgram, surfaceProgram } from './shaders.ts';
import type { StreamTextures } from './textures.ts';

/** Lamps that the draft knows; `LF_DRAFT_LIGHTS` in `lf_draft.glsl`. */
export const DRAFT_LIGHTS = 16;

/** Uniforms of all surfaces of a field: one object each, so that a change reaches every material. */
export interface SharedUniforms {
  [name: string]: IUniform;
  lfOutput: IUniform<number>;
  lfExposure: IUniform<number>;
  lfTexelGrid: IUniform<number>;
  lfDraftExposure: IUniform<number>;
  lfLightCount: IUniform<number>;
  lfLightPosition: IUniform<Vector3[]>;
  lfLightNormal: IUniform<Vector3[]>;
  lfLightPower: IUniform<Vector3[]>;
}

export function sharedUniforms(): SharedUniforms {
  const vectors = () => Array.from({ length: DRAFT_LIGHTS }, () => new Vector3());
  return {
    lfOutput: { value: 0 },
    lfExposure: { value: 1 },
    lfTexelGrid: { value: 0 },
    lfDraftExposure: { value: 1 },
    lfLightCount: { value: 0 },
    lfLightPosition: { value: vectors() },
    lfLightNormal: { value: vectors() },
    lfLightPower: { value: vectors() },
  };
}

/** What a surface tells its materials, whatever the scheme. */
export interface SurfaceUniforms {
  [name: string]: IUniform;
  lfSize: IUniform<Vector2>;
  lfGrid: IUniform<Vector2>;
  lfThetaFastest: IUniform<number>;
  lfDiffuse: IUniform<Vector3>;
  lfEmission: IUniform<Vector3>;
}

function material(scheme: Scheme, uniforms: Record<string, IUniform>, defines: Record<string, number>): RawShaderMaterial {
  const { vertex, fragment } = surfaceProgram(scheme);
  return new RawShaderMaterial({
    name: `kiln-${scheme}`,
    glslVersion: GLSL3,
    vertexShader: vertex,
    fragmentShader: fragment,
    uniforms,
    defines,
    side: FrontSide,
    // The pre-pass has written the depths; see `lf_depth.frag`.
    depthWrite: false,
    depthFunc: LessEqualDepth,
  });
}

const filterDefines = (hardware: boolean): Record<string, number> => (hardware ? { LF_HW_FILTER: 1 } : {});

/** Schemes `raw` and `expanded`. */
export function arrayMaterial(
  scheme: 'raw' | 'expanded', base: Record<string, IUniform>, texture: DataArrayTexture, layout: ArrayLayout, hardware: boolean,
): RawShaderMaterial {
  const own = { lfSamples: { value: texture }, lfCells: { value: new Vector2(layout.cellsX, layout.cellsY) } };
  return material(scheme, { ...base, ...own }, filterDefines(hardware));
}

export function streamedMaterial(base: Record<string, IUniform>, textures: StreamTextures): RawShaderMaterial {
  const own: Record<string, IUniform> = {
    lfStarts: { value: textures.starts },
    lfSteps: { value: textures.steps },
    lfColours: { value: textures.colours },
    lfLogRows: { value: new Vector3(...textures.logRows) },
  };
  if (textures.map) own.lfMap = { value: textures.map };
  return material('streamed', { ...base, ...own }, textures.map ? {} : { LF_DIRECT: 1 });
}

export const meanMaterial = (base: Record<string, IUniform>, texture: DataTexture, hardware: boolean): RawShaderMaterial =>
  material('mean', { ...base, lfMean: { value: texture } }, filterDefines(hardware));

/** The depth pre-pass. */
export const depthMaterial = (): RawShaderMaterial =>
  new RawShaderMaterial({
    name: 'kiln-depth',
    glslVersion: GLSL3,
    vertexShader: depthProgram.vertex,
    fragmentShader: depthProgram.fragment,
    side: FrontSide,
    colorWrite: false,
  });
