/**
 * The shaders, joined. Concatenation, not three's `#include`: the text that is compiled is then the text that tests hand to
 * glslangValidator.
 */

import arrayScheme from '../../../../shaders/lf_array.glsl?raw';
import common from '../../../../shaders/lf_common.glsl?raw';
import coverPart from '../../../../shaders/lf_cover.glsl?raw';
import coverVertex from '../../../../shaders/lf_cover_vertex.glsl?raw';
import depthFragment from '../../../../shaders/lf_depth.frag?raw';
import depthVertex from '../../../../shaders/lf_depth.vert?raw';
import draft from '../../../../shaders/lf_draft.glsl?raw';
import environmentFragment from '../../../../shaders/lf_environment.frag?raw';
import environmentVertex from '../../../../shaders/lf_environment.vert?raw';
import errorFragment from '../../../../shaders/lf_error.frag?raw';
import meanScheme from '../../../../shaders/lf_mean.glsl?raw';
import screenFragment from '../../../../shaders/lf_screen.frag?raw';
import screenVertex from '../../../../shaders/lf_screen.vert?raw';
import streamedScheme from '../../../../shaders/lf_streamed.glsl?raw';
import surfaceFragment from '../../../../shaders/lf_surface.frag?raw';
import surfaceVertex from '../../../../shaders/lf_surface.vert?raw';
import type { Scheme } from '../viewer/api.ts';

/** A program's two shaders, without the version line and defines that three puts before them. */
export interface Program {
  vertex: string;
  fragment: string;
}

const PRECISION = 'precision highp float;\nprecision highp int;\n';
const SCHEMES: Record<Scheme, string> = { raw: arrayScheme, expanded: arrayScheme, streamed: streamedScheme, mean: meanScheme };

const join = (...parts: string[]): string => PRECISION + parts.join('\n');

/** The program that draws a surface with a scheme. */
export const surfaceProgram = (scheme: Scheme): Program => ({
  vertex: join(coverVertex, surfaceVertex),
  fragment: join(common, SCHEMES[scheme], draft, coverPart, surfaceFragment),
});

/** The program of the pre-pass: of what covers, and of masks, whose holes it leaves. */
export const depthProgram: Program = { vertex: join(coverVertex, depthVertex), fragment: join(coverPart, depthFragment) };
export const environmentProgram: Program = { vertex: join(environmentVertex), fragment: join(common, environmentFragment) };
export const errorProgram: Program = { vertex: join(screenVertex), fragment: join(common, errorFragment) };
export const screenProgram: Program = { vertex: join(screenVertex), fragment: join(common, screenFragment) };

/** Every variant that the viewer compiles, as complete sources, for validators. */
export function shaderVariants(): { name: string; stage: 'vert' | 'frag'; source: string }[] {
  const surface = (['expanded', 'mean'] as const).flatMap((scheme) => [
    { name: `${scheme}-hardware`, program: surfaceProgram(scheme), defines: ['LF_HW_FILTER 1'] },
    { name: `${scheme}-exact`, program: surfaceProgram(scheme), defines: [] },
  ]);
  const streamed = [
    { name: 'streamed', program: surfaceProgram('streamed'), defines: [] },
    { name: 'streamed-direct', program: surfaceProgram('streamed'), defines: ['LF_DIRECT 1'] },
  ];
  type Variant = { name: string; program: Program; defines: string[] };
  const mask = (of: Variant) => ({ ...of, name: `${of.name}-mask`, defines: [...of.defines, 'LF_COVER 1'] });
  const blend = (of: Variant) => ({ ...of, name: `${of.name}-blend`, defines: [...of.defines, 'LF_COVER 2'] });
  const covering = [...surface, ...streamed].flatMap((variant) => [variant, mask(variant), blend(variant)]);
  const depth = { name: 'depth', program: depthProgram, defines: [] };
  const others: Variant[] = [
    depth,
    mask(depth),
    { name: 'environment', program: environmentProgram, defines: [] },
    { name: 'error', program: errorProgram, defines: [] },
    { name: 'screen', program: screenProgram, defines: [] },
  ];
  return [...covering, ...others].flatMap(({ name, program, defines }) => {
    const head = `#version 300 es\n${defines.map((d: string) => `#define ${d}\n`).join('')}`;
    return [
      { name, stage: 'vert' as const, source: head + program.vertex },
      { name, stage: 'frag' as const, source: head + program.fragment },
    ];
  });
}
