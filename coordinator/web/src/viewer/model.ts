/** What is loaded and how it is drawn, for lists and inspectors. */

import type { WebGLRenderer } from 'three';
import type { LightFieldObject } from '../gl/object.ts';
import type { Scheme, ViewerModel, ViewerStats } from './api.ts';
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
    environment: field.container.scene.environment?.name ?? null,
    hasRaw: field.loadRaw !== null,
    live: field.manifest === null,
  };
}

/** Figures of the frame that `renderer` drew last; `drawing` are those that its owner keeps. */
export function statsOf(
  object: LightFieldObject | null, renderer: WebGLRenderer, drawing: Pick<ViewerStats, 'fps' | 'frameMs' | 'budgetBytes' | 'firstPictureMs' | 'busy'>,
): ViewerStats {
  const { render } = renderer.info;
  const schemes: Partial<Record<Scheme, number>> = {};
  for (const { scheme } of object?.surfaces ?? []) if (scheme) schemes[scheme] = (schemes[scheme] ?? 0) + 1;
  return {
    ...drawing,
    drawCalls: render.calls,
    triangles: render.triangles,
    textureBytes: object?.bytes ?? 0,
    codec: String(object?.field.container.plan.settings.codec ?? ''),
    schemes,
  };
}
