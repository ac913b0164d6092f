/** The library: `kiln-viewer.js` of the service and of exported folders, and the npm package. Importing it defines `<kiln-viewer>`. */

export { LightFieldLoader, type PackageFiles } from './loader.ts';
export { type LightField, makeLiveField } from './field/light-field.ts';
export { LightFieldObject, type PrepareOptions } from './gl/object.ts';
export { shaderVariants } from './gl/shaders.ts';
export { KilnViewer } from './viewer/element.ts';
export type * from './viewer/api.ts';
