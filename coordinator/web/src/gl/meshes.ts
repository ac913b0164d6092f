/**
 * The meshes of a surface: one for all that covers what lies behind it, one for each way of not doing so. They share their vertices and differ in which
 * triangles they draw. What is blended has no depth of its own: it is drawn last, back to front, and hides nothing.
 */

import { Box3, BufferAttribute, BufferGeometry, DynamicDrawUsage, type Group, Mesh, RawShaderMaterial, Sphere, Vector3 } from 'three';
import type { Vec3 } from '../format/bytes.ts';
import type { Cover } from '../field/cover.ts';
import type { FieldSurface } from '../field/light-field.ts';
import type { ChannelTextures } from './channels.ts';
import { type CoverUniforms, coverUniforms, depthMaterial } from './material.ts';
import { sortBackToFront } from './sorting.ts';

/** Drawn before everything that is not of a light field, and every pre-pass before every colour pass. */
const FIRST = -1000;

export interface SurfaceMesh {
  mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  /** The pre-pass; null where there is none. */
  depth: Mesh<BufferGeometry, RawShaderMaterial> | null;
  /** null for what covers all. */
  cover: Cover | null;
  uniforms: CoverUniforms | null;
  /** Where the eye was when its triangles were sorted last; null before. */
  sortedFor: Vec3 | null;
}

/** Makes the meshes and adds them to `group`. `depthOnly` is the pre-pass of all that covers; `empty` makes the material to begin with. */
export function surfaceMeshes(
  surface: FieldSurface, group: Group, channels: ChannelTextures, depthOnly: RawShaderMaterial, empty: (cover: CoverUniforms | null) => RawShaderMaterial,
): SurfaceMesh[] {
  const { cover } = surface;
  const vertices = attributes(surface);
  const whole = !cover || cover.opaque.length > 0;
  const opaque: (Cover | null)[] = whole ? [null] : [];
  return [...opaque, ...(cover?.covers ?? [])].map((own): SurfaceMesh => {
    const triangles = own?.triangles ?? cover?.opaque ?? null;
    const geometry = geometryOf(vertices, triangles, own?.blended ?? false);
    const uniforms = own && coverUniforms(own, channels);
    const mesh = new Mesh(geometry, empty(uniforms));
    mesh.renderOrder = own?.blended ? 0 : FIRST + 1;
    mesh.userData = { surface: surface.index, cover: own };
    group.add(mesh);
    return { mesh, depth: own?.blended ? null : depthMesh(geometry, uniforms ? depthMaterial(uniforms) : depthOnly, group), cover: own, uniforms, sortedFor: null };
  });
}

function depthMesh(geometry: BufferGeometry, material: RawShaderMaterial, group: Group): Mesh<BufferGeometry, RawShaderMaterial> {
  const depth = new Mesh(geometry, material);
  depth.renderOrder = FIRST;
  // The mesh beside it is what is picked.
  depth.raycast = () => {};
  group.add(depth);
  return depth;
}

/** Draws the triangles of a blended mesh from the farthest to the nearest, as seen from `eye` in the space of the scene. */
export function sortMesh(it: SurfaceMesh, positions: Float32Array, eye: Vec3): void {
  const { index } = it.mesh.geometry;
  if (!it.cover?.blended || !index || it.sortedFor?.every((v, axis) => v === eye[axis])) return;
  sortBackToFront(it.cover.triangles, positions, eye, index.array as Uint32Array);
  index.needsUpdate = true;
  it.sortedFor = eye;
}

type Vertices = Record<string, BufferAttribute>;

function attributes({ geometry, cover }: FieldSurface): Vertices {
  const { positions, normals, tangents, uvs, charts, parts } = geometry;
  return {
    position: new BufferAttribute(positions, 3),
    normal: new BufferAttribute(normals, 3),
    tangent: new BufferAttribute(tangents, 3),
    uv: new BufferAttribute(uvs, 2),
    chart: new BufferAttribute(charts, 1),
    part: new BufferAttribute(parts, 1),
    ...(cover && { alphaAt: new BufferAttribute(cover.alphaAt, 4), passingAt: new BufferAttribute(cover.passingAt, 4) }),
  };
}

/** `triangles` null: all of them. */
function geometryOf(vertices: Vertices, triangles: Uint32Array | null, dynamic: boolean): BufferGeometry {
  const out = new BufferGeometry();
  for (const [name, attribute] of Object.entries(vertices)) out.setAttribute(name, attribute);
  if (!triangles) {
    out.computeBoundingSphere();
    return out;
  }
  const corners = new Uint32Array(triangles.length * 3);
  triangles.forEach((t, i) => corners.set([t * 3, t * 3 + 1, t * 3 + 2], i * 3));
  const index = new BufferAttribute(corners, 1);
  if (dynamic) index.setUsage(DynamicDrawUsage);
  out.setIndex(index);
  out.boundingSphere = sphereOf(vertices.position, corners);
  return out;
}

/** Around the triangles alone: three's own would take every vertex. It decides what is culled, and which of two blended meshes is drawn first. */
function sphereOf(positions: BufferAttribute, corners: Uint32Array): Sphere {
  const [box, point] = [new Box3(), new Vector3()];
  for (const v of corners) box.expandByPoint(point.fromBufferAttribute(positions, v));
  const sphere = new Sphere(box.getCenter(new Vector3()), 0);
  for (const v of corners) sphere.radius = Math.max(sphere.radius, sphere.center.distanceTo(point.fromBufferAttribute(positions, v)));
  return sphere;
}
