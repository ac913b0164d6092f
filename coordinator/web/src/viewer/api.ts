/**
 * What the pages may ask of a viewer, and what it tells them: the face of `<kiln-viewer>` that tools build on. The element implements it;
 * pages and panels import types from here and nothing from the element's inside.
 *
 * Radiance is W/(sr m²), linear Rec. 709. Angles in attributes and in this file's `OrbitPosition` are degrees, everywhere else radians.
 */

/** What is drawn. `error` needs raw radiance in the package; see {@link ViewerModel.hasRaw}. */
export type ViewMode = 'light-field' | 'diffuse' | 'error';

/** How a surface's samples lie on the GPU. `mean` is what is left when the memory budget allows no more: no view dependence. */
export type Scheme = 'raw' | 'expanded' | 'streamed' | 'mean';

/** A camera on a sphere around its target: degrees and metres. */
export interface OrbitPosition {
  /** Azimuth about +Y, degrees; 0 looks along -Z. */
  theta: number;
  /** Inclination from +Y, degrees in (0, 180). */
  phi: number;
  /** Distance from the target, metres. */
  radius: number;
}

/** A run of triangles of one material within a surface. */
export interface PartModel {
  name: string;
  material: string;
  triangles: number;
}

/** One surface, for lists and inspectors. */
export interface SurfaceModel {
  /** The back of a two-sided surface has a light field and a name of its own, `NAME~back`. */
  name: string;
  /** The index of the surface whose back this is. */
  backOf: number | null;
  parts: PartModel[];
  fileStem: string;
  width: number;
  height: number;
  /** Covered texels. */
  covered: number;
  triangles: number;
  /** Number of the surface's first tile in the Bake phase, and how many it has: which tiles of a job are this surface's. */
  firstTile: number;
  tileCount: number;
  /** How it is drawn now; null while nothing of it is loaded. */
  scheme: Scheme | null;
  /** Bytes of its textures on the GPU. */
  gpuBytes: number;
  /** From the manifest; null while the job bakes. */
  ratio: number | null;
  averageError: number | null;
  maxError: number | null;
}

/** What is loaded. */
export interface ViewerModel {
  surfaces: SurfaceModel[];
  triangles: number;
  grid: { nTheta: number; nPhi: number };
  codec: string;
  exposureStops: number;
  bounds: { low: [number, number, number]; high: [number, number, number] };
  /** Names of the author's cameras, distinct. */
  cameras: string[];
  /** The file of the environment, which is seen behind the scene unless `hideEnvironment` says otherwise; null without one. */
  environment: string | null;
  /** Whether the package kept raw radiance, so that `error` can be drawn. */
  hasRaw: boolean;
  /** A job that still bakes, not a package. */
  live: boolean;
}

/** Figures of the frame drawn last. */
export interface ViewerStats {
  /** Frames per second while frames follow each other; 0 when the view rests, since frames are drawn on demand. */
  fps: number;
  /** Milliseconds from the submission of the last frame to the moment the GPU had finished it. */
  frameMs: number;
  drawCalls: number;
  triangles: number;
  /** Bytes of textures on the GPU, and the budget that they were fitted into. */
  textureBytes: number;
  budgetBytes: number;
  /** Milliseconds from `src` to the first complete picture; null before. */
  firstPictureMs: number | null;
  codec: string;
  /** Whether samples are still on their way to the GPU. */
  busy: boolean;
  /** Surfaces by scheme. */
  schemes: Partial<Record<Scheme, number>>;
}

/** The hemisphere of one texel, as decoded: what the polar plot draws. */
export interface TexelSample {
  surface: string;
  surfaceIndex: number;
  /** The part of the surface under the point; the surface's own name where it has only this. */
  part: string;
  x: number;
  y: number;
  /** World position of the picked point, metres. */
  position: [number, number, number];
  grid: { nTheta: number; nPhi: number };
  /** D x 3 sRGB-coded bytes in depth order (depth = i * nPhi + j; theta_i = (i + 1/2) * 90/nTheta degrees, phi_j = j * 360/nPhi). */
  coded: Uint8Array;
  /** D x 3 linear radiances, W/(sr m²). */
  radiance: Float32Array;
  /** Samples that the codec kept of this texel. */
  keptSamples: number;
  /** Direction toward the camera at the time of the pick, in the texel's frame: theta and phi in degrees. */
  view: { theta: number; phi: number };
  /** Gutter and uncovered texels have no samples of their own. */
  covered: boolean;
}

/** Events: `load` (the first complete picture), `progress` {@link ProgressDetail}, `error` {@link ErrorDetail}, `camera-change`, `pick`
 * ({@link TexelSample} | null), `stats` ({@link ViewerStats}, after each drawn frame), `model` ({@link ViewerModel}, when it changes). */
export interface ProgressDetail {
  /** In [0, 1]. */
  totalProgress: number;
}

export interface ErrorDetail {
  /** `webgl` (the browser cannot), `loadfailure`, `shader`, `context-lost`. */
  type: 'webgl' | 'loadfailure' | 'shader' | 'context-lost';
  /** A sentence for people. */
  message: string;
}

/** The element. */
export interface KilnViewerElement extends HTMLElement {
  /** URL of a manifest.json. Setting it loads the package. */
  src: string;
  alt: string;
  mode: ViewMode;
  /** Lines along texel borders. */
  texelGrid: boolean;
  /** Leaves the environment, which is seen behind the scene, away: one colour is there then, as in scenes without an environment. */
  hideEnvironment: boolean;
  /** 'auto' fits the memory budget; the others force one scheme for comparisons. */
  scheme: 'auto' | Exclude<Scheme, 'mean'>;
  /** 'hardware' lets the sampler interpolate between texels, 'exact' does it in the shader. */
  filter: 'hardware' | 'exact';
  /** Factor on radiance beside the exposure of the package; 1 by default. */
  exposure: number;
  /** Budget for textures, MiB. */
  memoryBudget: number;
  autoRotate: boolean;
  /**
   * The author's camera that is the first view; empty for a view that the viewer chooses. A name that the scene does not have counts as
   * empty.
   */
  cameraName: string;
  /** Whether the camera stands elsewhere than in the first view. */
  readonly cameraMoved: boolean;
  readonly loaded: boolean;
  readonly model: ViewerModel | null;
  readonly stats: ViewerStats;

  /** Shows a job while it bakes: the bytes of its scene.kiln with the plan as it is now. Tiles come through {@link addSegments}. A later
   * call (the exposure is known now) begins anew and keeps camera and settings. */
  showLive(sceneKiln: ArrayBuffer): void;
  /** Adds finished tiles: a body of GET /v1/jobs/{id}/segments. Returns the numbers of the tiles in it, in their order. */
  addSegments(body: ArrayBuffer): number[];

  getCameraOrbit(): OrbitPosition;
  getCameraTarget(): [number, number, number];
  /** Degrees, vertical. */
  getFieldOfView(): number;
  /** Places the camera: eye and target in metres, vertical field of view in degrees. */
  setCamera(eye: [number, number, number], target: [number, number, number], fieldOfView?: number): void;
  getCamera(): { eye: [number, number, number]; target: [number, number, number]; fieldOfView: number };
  resetCamera(): void;
  jumpCameraToGoal(): void;
  toDataURL(type?: string, quality?: number): string;
  toBlob(options?: { mimeType?: string; qualityArgument?: number }): Promise<Blob>;
  /**
   * A view of this size in floats, four a pixel, bottom row first. `radiance`: linear radiance x 2^stops, of each layer at most 16,000, and
   * as alpha the number of the chart, from 1, 0 behind the scene, where the environment is unless it is hidden; what is not baked is 0.
   * `lookup`: what is looked up there: u, v, and x and y of the direction toward the eye in the texel's frame. Chart and look-up are those
   * of what is opaque; glass before it is in the radiance alone.
   */
  renderFloats(what: 'radiance' | 'lookup', width: number, height: number): Float32Array;
  /** Draws frames one after another, each finished before the next begins; their milliseconds. */
  benchmark(frames: number): number[];
  /** Picks the texel under a point of the element, CSS pixels from its left top corner; also fires `pick`. */
  pickAt(x: number, y: number): TexelSample | null;
}
