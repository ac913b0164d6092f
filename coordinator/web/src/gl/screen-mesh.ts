/** One triangle over the whole target, whatever the camera and the depths there: less to draw than a rectangle, and no seam across it. */

import { BufferAttribute, BufferGeometry, GLSL3, type IUniform, Mesh, RawShaderMaterial } from 'three';
import type { Program } from './shaders.ts';

export class ScreenMesh extends Mesh<BufferGeometry, RawShaderMaterial> {
  constructor(name: string, { vertex, fragment }: Program, uniforms: Record<string, IUniform>) {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    const state = { glslVersion: GLSL3, depthTest: false, depthWrite: false };
    super(geometry, new RawShaderMaterial({ name, vertexShader: vertex, fragmentShader: fragment, uniforms, ...state }));
    this.frustumCulled = false;
  }

  override dispose(): void {
    this.geometry.dispose();
    this.material.dispose();
  }
}
