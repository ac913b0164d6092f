/** The table of parts for the draft: what each reflects and emits. A texture, since a scene may have thousands. */

import { DataTexture, FloatType, NearestFilter, RGBAFormat } from 'three';
import { meanEmission, meanReflectance } from '../field/draft.ts';
import type { Scene } from '../format/scene.ts';

/** Parts in a row of the table; `LF_PARTS_A_ROW` in `lf_draft.glsl`. */
const A_ROW = 512;

/** Two texels a part, in the order of surfaces and their parts: reflectance; emission, W/(sr m²). */
export function partTable(scene: Scene): DataTexture {
  const parts = scene.surfaces.flatMap((surface) => surface.parts);
  const [width, height] = [2 * Math.min(A_ROW, Math.max(1, parts.length)), Math.max(1, Math.ceil(parts.length / A_ROW))];
  const data = new Float32Array(width * height * 4);
  parts.forEach(({ material: index }, p) => {
    const material = scene.materials[index];
    data.set(meanReflectance(scene, material), p * 8);
    data.set(meanEmission(scene, material), p * 8 + 4);
  });
  const table = new DataTexture(data, width, height, RGBAFormat, FloatType);
  table.minFilter = table.magFilter = NearestFilter;
  table.needsUpdate = true;
  return table;
}
