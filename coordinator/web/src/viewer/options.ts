/** How a stage draws: what the element's attributes say. */

import type { Scheme, ViewMode } from './api.ts';

export interface StageOptions {
  mode: ViewMode;
  scheme: 'auto' | Exclude<Scheme, 'mean'>;
  hardware: boolean;
  exposure: number;
  texelGrid: boolean;
  /** Whether the environment is seen behind the scene. */
  environment: boolean;
  /** Bytes. */
  budget: number;
}

export const usualOptions = (): StageOptions => ({
  mode: 'light-field', scheme: 'auto', hardware: true, exposure: 1, texelGrid: false, environment: true, budget: 512 << 20,
});
