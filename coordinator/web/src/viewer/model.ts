/** What is loaded, for lists and inspectors. */

import type { LightFieldObject } from '../gl/object.ts';
import type { ViewerModel } from './api.ts';
import { cameraNames } from './cameras.ts';

export function modelOf(object: LightFieldObject): ViewerModel {
  const { field } = object;
  return {
    surfaces: field.surfaces.map((surface, i) => {
      const { backOf, parts } = field.container.scene.surfaces[surface.index];
      const encoding = field.manifest?.surfaces[i].encoding;
      return {
        name: surface.name,
        backOf,
        parts: parts.map(({ name, material, end }, p) => ({
          name, material: field.container.scene.materials[material].name, triangles: end - (parts[p - 1]?.end ?? 0),
        })),
        fileStem: surface.fileStem,
        width: surface.plan.width,
        height: surface.plan.height,
        covered: surface.plan.covered,
        triangles: surface.geometry.triangles,
        firstTile: surface.firstTile,
        tileCount: surface.plan.tiles.length,
        scheme: object.surfaces[i].scheme,
        gpuBytes: object.surfaces[i].bytes,
        ratio: encoding?.ratio ?? null,
        averageError: encoding?.errors.average ?? null,
        maxError: encoding?.errors.max ?? null,
      };
    }),
    triangles: field.surfaces.reduce((sum, surface) => sum + surface.geometry.triangles, 0),
    grid: field.grid,
    codec: String(field.container.plan.settings.codec),
    exposureStops: field.exposureStops,
    bounds: field.bounds,
    cameras: cameraNames(field.container.scene.cameras),
    hasRaw: field.loadRaw !== null,
    live: field.manifest === null,
  };
}
