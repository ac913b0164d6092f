/**
 * The environment of a scene as what lies behind it: one triangle over the view, drawn before everything else in the same pass, so that
 * glass is blended over it and edges are smoothed against it. A sphere around the camera would need nothing of the projection and be cut by
 * its far plane.
 */

import { ClampToEdgeWrapping, DataTexture, HalfFloatType, LinearFilter, RGBAFormat, RepeatWrapping } from 'three';
import type { Environment } from '../format/environment.ts';
import type { SharedUniforms } from './material.ts';
import { ScreenMesh } from './screen-mesh.ts';
import { environmentProgram } from './shaders.ts';
import { toHalf } from './textures.ts';

/** Before the pre-passes of all surfaces. */
const BEFORE_ALL = -2000;

export class Background extends ScreenMesh {
  /** Bytes of its texture. */
  readonly bytes: number;
  private readonly picture: DataTexture;

  /** The exposure of the draft, 2^stops where they are known, is that of its whole life. */
  constructor(environment: Environment, shared: SharedUniforms) {
    const picture = pictureOf(environment, shared.lfDraftExposure.value);
    const { lfOutput, lfExposure } = shared;
    const own = { lfEnvironment: { value: picture }, lfTurns: { value: turnsOf(environment.rotation) } };
    super('kiln-environment', environmentProgram, { ...own, lfOutput, lfExposure });
    this.picture = picture;
    this.bytes = environment.width * environment.height * 8;
    this.renderOrder = BEFORE_ALL;
  }

  /** There is nothing to pick. */
  override raycast(): void {}

  override dispose(): void {
    this.picture.dispose();
    super.dispose();
  }
}

/** The fraction of a turn: many turns would leave a float no digits for where they end. */
function turnsOf(rotation: number): number {
  const turns = rotation / (2 * Math.PI);
  return turns - Math.floor(turns);
}

/**
 * Radiance times `exposure` in half floats. A sky in cd/m² is beyond them and moonlight below: what is cut must be too bright for the
 * view, not for the format.
 */
function pictureOf({ width, height, texels }: Environment, exposure: number): DataTexture {
  const rgba = new Float32Array(width * height * 4).fill(1);
  for (let t = 0; t < width * height; t++) for (let c = 0; c < 3; c++) rgba[t * 4 + c] = texels[t * 3 + c] * exposure;
  const picture = new DataTexture(toHalf(rgba) as Uint16Array<ArrayBuffer>, width, height, RGBAFormat, HalfFloatType);
  picture.wrapS = RepeatWrapping;
  picture.wrapT = ClampToEdgeWrapping;
  picture.minFilter = picture.magFilter = LinearFilter;
  picture.needsUpdate = true;
  return picture;
}
