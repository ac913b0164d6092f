// The library as a package: `kiln-viewer.js` with three left out, so that a page has one three.js, its own. Everything else, the decoding
// worker among it, is in the folder.
import { resolve } from 'node:path';
import { defineConfig } from 'vite';

export default defineConfig({
  build: {
    outDir: 'lib',
    emptyOutDir: true,
    target: 'es2022',
    assetsInlineLimit: 0,
    lib: { entry: resolve(import.meta.dirname, 'src/lib.ts'), formats: ['es'], fileName: 'kiln-viewer' },
    rolldownOptions: { external: [/^three(\/|$)/] },
  },
  worker: { format: 'es' },
});
