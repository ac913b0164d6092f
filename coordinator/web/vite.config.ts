// Four entries into one folder: the farm's dashboard, the page of a job, the page that `kiln fetch --with-viewer` exports, and the library
// by itself under a name that does not change. URLs are relative, so that the folder works under any path of any web server.
import { resolve } from 'node:path';
import { defineConfig } from 'vite';

const at = (file: string) => resolve(import.meta.dirname, file);

export default defineConfig({
  base: './',
  server: { fs: { allow: [at('..'), at('../../shaders')] } },
  build: {
    outDir: 'dist',
    emptyOutDir: true,
    target: 'es2022',
    // A data: URL would be refused by the Content-Security-Policy of the pages.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 900,
    rolldownOptions: {
      input: { dashboard: at('index.html'), job: at('job.html'), viewer: at('viewer.html'), 'kiln-viewer': at('src/lib.ts') },
      preserveEntrySignatures: 'exports-only',
      output: { entryFileNames: (chunk) => (chunk.name === 'kiln-viewer' ? 'kiln-viewer.js' : 'assets/[name]-[hash].js') },
    },
  },
  worker: { format: 'es' },
});
