/**
 * Draws frames of one light field: the plain view, the error map as two pictures and their difference, and linear radiance for reading
 * back. A scene with glass in it is drawn in linear light and then brought to the screen: light adds up as light, not as the bytes of a
 * display.
 */

import {
  Camera, Color, FloatType, HalfFloatType, NearestFilter, type OrthographicCamera, type PerspectiveCamera, type Scene, Vector3, WebGLRenderTarget,
  type WebGLRenderer,
} from 'three';
import type { ViewMode } from '../viewer/api.ts';
import type { LightFieldObject } from './object.ts';
import { ScreenMesh } from './screen-mesh.ts';
import { errorProgram, screenProgram } from './shaders.ts';

/** sRGB of what lies behind the scene; `kiln render` has the same. */
export const BACKGROUND = 0x202428;
/** Levels at the end of the error scale. */
export const ERROR_RANGE = 8;
/** Samples a pixel of what is drawn in linear light; browsers give a canvas as many. */
const SAMPLES = 4;

export class Painter {
  private readonly renderer: WebGLRenderer;
  private readonly targets: WebGLRenderTarget[] = [];
  /** Linear light, for what is blended; made when first drawn. */
  private blending: WebGLRenderTarget | null = null;
  private readonly errorMesh: ScreenMesh;
  private readonly screenMesh: ScreenMesh;
  private readonly screenCamera = new Camera() as OrthographicCamera;

  constructor(renderer: WebGLRenderer) {
    this.renderer = renderer;
    this.settle();
    this.errorMesh = new ScreenMesh('kiln-error', errorProgram, {
      lfShown: { value: null },
      lfReference: { value: null },
      lfExposure: { value: 1 },
      lfErrorRange: { value: ERROR_RANGE },
      lfBackground: { value: new Vector3(BACKGROUND >> 16, (BACKGROUND >> 8) & 255, BACKGROUND & 255).divideScalar(255) },
    });
    this.screenMesh = new ScreenMesh('kiln-screen', screenProgram, { lfShown: { value: null } });
  }

  /** State that a context begins without, also one that comes back. */
  settle(): void {
    this.renderer.setClearColor(new Color(BACKGROUND), 1);
  }

  /** One frame on the canvas. */
  draw(scene: Scene, camera: PerspectiveCamera, object: LightFieldObject | null, mode: ViewMode, hardware: boolean): void {
    // Until raw radiance is there, the plain view: half of a comparison shows errors that are none.
    if (mode === 'error' && object?.surfaces.every((view) => view.hasRaw)) {
      this.drawError(scene, camera, object, hardware);
      return;
    }
    object?.show(mode === 'diffuse' ? 'mean' : 'shown', hardware);
    object?.sort(camera);
    if (object?.blended && this.drawsFloats) this.drawBlended(scene, camera, object);
    else this.renderer.render(scene, camera);
  }

  /**
   * What every pixel holds, bottom row first, four floats each. `radiance`: linear radiance times 2^stops, and as alpha the number of the
   * chart (from 1; 0 behind the scene). `lookup`: what is looked up there, u, v and the x and y of the direction toward the eye in the
   * texel's frame. Resolution and antialiasing of the canvas play no part.
   */
  read(
    scene: Scene, camera: PerspectiveCamera, object: LightFieldObject, what: 'radiance' | 'lookup', look: { mode: ViewMode; hardware: boolean },
    width: number, height: number,
  ): Float32Array {
    const target = new WebGLRenderTarget(width, height, { type: FloatType, minFilter: NearestFilter, magFilter: NearestFilter });
    object.show(look.mode === 'diffuse' ? 'mean' : 'shown', look.hardware);
    this.linear(scene, camera, object, target, what === 'lookup' ? 2 : 1);
    const out = new Float32Array(width * height * 4);
    this.renderer.readRenderTargetPixels(target, 0, 0, width, height, out);
    target.dispose();
    return out;
  }

  dispose(): void {
    this.targets.forEach((target) => target.dispose());
    this.blending?.dispose();
    this.errorMesh.dispose();
    this.screenMesh.dispose();
  }

  /** Nearly every GPU does; on others light adds up as the bytes of the display do. */
  private get drawsFloats(): boolean {
    const { extensions } = this.renderer;
    return extensions.has('EXT_color_buffer_float') || extensions.has('EXT_color_buffer_half_float');
  }

  private drawBlended(scene: Scene, camera: PerspectiveCamera, object: LightFieldObject): void {
    const { drawingBufferWidth: width, drawingBufferHeight: height } = this.renderer.getContext();
    const filters = { minFilter: NearestFilter, magFilter: NearestFilter };
    const target = (this.blending ??= new WebGLRenderTarget(width, height, { type: HalfFloatType, samples: SAMPLES, ...filters }));
    target.setSize(width, height);
    object.setOutput(3);
    this.renderer.setRenderTarget(target);
    this.renderer.render(scene, camera);
    this.renderer.setRenderTarget(null);
    object.setOutput(0);
    this.screenMesh.material.uniforms.lfShown.value = target.texture;
    this.renderer.render(this.screenMesh, this.screenCamera);
  }

  private drawError(scene: Scene, camera: PerspectiveCamera, object: LightFieldObject, hardware: boolean): void {
    const { drawingBufferWidth: width, drawingBufferHeight: height } = this.renderer.getContext();
    const [shown, reference] = this.sized(width, height);
    object.show('shown', hardware);
    this.linear(scene, camera, object, shown);
    object.show('raw', hardware);
    this.linear(scene, camera, object, reference);
    const { uniforms } = this.errorMesh.material;
    uniforms.lfShown.value = shown.texture;
    uniforms.lfReference.value = reference.texture;
    uniforms.lfExposure.value = object.uniforms.lfExposure.value;
    this.renderer.render(this.errorMesh, this.screenCamera);
  }

  private sized(width: number, height: number): WebGLRenderTarget[] {
    while (this.targets.length < 2) {
      this.targets.push(new WebGLRenderTarget(width, height, { type: HalfFloatType, minFilter: NearestFilter, magFilter: NearestFilter }));
    }
    this.targets.forEach((target) => target.setSize(width, height));
    return this.targets;
  }

  private linear(scene: Scene, camera: PerspectiveCamera, object: LightFieldObject, target: WebGLRenderTarget, output = 1): void {
    const { renderer } = this;
    const alpha = renderer.getClearAlpha();
    object.sort(camera);
    object.setOutput(output);
    renderer.setClearAlpha(0);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    renderer.setRenderTarget(null);
    renderer.setClearAlpha(alpha);
    object.setOutput(0);
  }
}
