/**
 * The meshes of a surface: one for all that covers what lies behind it, one for each way of not doing so. They share their vertices and
 * differ in which triangles they draw. What is blended has no depth of its own: it is drawn last, back to front, and hides nothing.
 *
 * Blending knows one opacity a fragment. Coloured glass has three: it is drawn once for each of red, green and blue, with a mask that
 * leaves the others alone, so that each channel is blended exactly and in order. Multiplying first and adding afterwards takes two passes
 * and is wrong wherever two triangles of a mesh lie behind each other.
 */

import { Box3, BufferAttribute, BufferGeometry, DynamicDrawUsage, type Group, type IUniform, Mesh, RawShaderMaterial, Sphere, Vector3 } from 'three';
import type { Vec3 } from '../format/bytes.ts';
import type { Cover } from '../field/cover.ts';
import type { FieldSurface } from '../field/light-field.ts';
import type { ChannelTextures } from './channels.ts';
import { lookUpAttributes } from './look-ups.ts';
import { type CoverUniforms, coverUniforms, depthMaterial } from './material.ts';
import { sortBackToFront } from './sorting.ts';

/** Drawn before everything that is not of a light field, and every pre-pass before every colour pass. */
const FIRST = -1000;

type DrawnMesh = Mesh<BufferGeometry, RawShaderMaterial>;

export interface SurfaceMesh {
  /** One, or one for each channel; they differ in nothing else. The first is what is picked. */
  meshes: DrawnMesh[];
  /** The pre-pass; null where there is none. */
  depth: DrawnMesh | null;
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
    const material = empty(uniforms);
    const meshes = (uniforms?.tinted ? [0, 1, 2] : [null]).map((channel) => {
      const mesh = new Mesh(geometry, material);
      mesh.renderOrder = own?.blended ? 0 : FIRST + 1;
      mesh.userData = { surface: surface.index, cover: own };
      if (channel !== null && uniforms) drawChannel(mesh, channel, uniforms.lfChannel);
      return mesh;
    });
    group.add(...meshes);
    return { meshes, depth: own?.blended ? null : depthMesh(geometry, uniforms ? depthMaterial(uniforms) : depthOnly, group), cover: own, uniforms, sortedFor: null };
  });
}

/** Has a mesh write one channel; that of blue writes alpha, too. three masks all channels or none. */
function drawChannel(mesh: DrawnMesh, channel: number, lfChannel: IUniform<Vector3>): void {
  const only = (c: number) => c === channel;
  mesh.onBeforeRender = (renderer) => {
    lfChannel.value.set(Number(only(0)), Number(only(1)), Number(only(2)));
    mesh.material.uniformsNeedUpdate = true;
    // Through three first, which then takes the mask for what it set itself and leaves it.
    renderer.state.buffers.color.setMask(true);
    renderer.getContext().colorMask(only(0), only(1), only(2), only(2));
  };
  mesh.onAfterRender = (renderer) => renderer.getContext().colorMask(true, true, true, true);
  if (channel > 0) mesh.raycast = () => {};
}

/** Gives a material to all meshes that draw the same. */
export const setMaterial = ({ meshes }: SurfaceMesh, material: RawShaderMaterial): void => meshes.forEach((mesh) => (mesh.material = material));

function depthMesh(geometry: BufferGeometry, material: RawShaderMaterial, group: Group): DrawnMesh {
  const depth = new Mesh(geometry, material);
  depth.renderOrder = FIRST;
  // The mesh beside it is what is picked.
  depth.raycast = () => {};
  group.add(depth);
  return depth;
}

/** Draws the triangles of a blended mesh from the farthest to the nearest, as seen from `eye` in the space of the scene. */
export function sortMesh(it: SurfaceMesh, positions: Float32Array, eye: Vec3): void {
  const { index } = it.meshes[0].geometry;
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
    ...(cover && { coverAt: new BufferAttribute(cover.at, 4) }),
    ...lookUpAttributes(cover?.lookUps ?? {}),
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

/**
 * Around the triangles alone: three's own would take every vertex. It decides what is culled, and which of two blended meshes is drawn
 * first.
 */
function sphereOf(positions: BufferAttribute, corners: Uint32Array): Sphere {
  const [box, point] = [new Box3(), new Vector3()];
  for (const v of corners) box.expandByPoint(point.fromBufferAttribute(positions, v));
  const sphere = new Sphere(box.getCenter(new Vector3()), 0);
  for (const v of corners) sphere.radius = Math.max(sphere.radius, sphere.center.distanceTo(point.fromBufferAttribute(positions, v)));
  return sphere;
}
