// Headless Chromium on one of two software GPUs, driven by playwright-core; what a page says on its console fails the test.
import fs from 'node:fs';
import { chromium } from 'playwright-core';

const GPU = {
  // Filters textures exactly.
  swiftshader: ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'],
  // Mesa's, with coarse filter weights like a real GPU's; several times faster.
  llvmpipe: ['--use-gl=angle', '--use-angle=gl-egl', '--ignore-gpu-blocklist'],
  // A browser without WebGL.
  none: ['--disable-gpu', '--disable-3d-apis'],
};
const COMMON = [
  '--no-sandbox', '--disable-dev-shm-usage', '--disable-background-networking', '--disable-component-update', '--disable-sync', '--no-first-run',
  '--force-color-profile=srgb', '--force-device-scale-factor=1', '--hide-scrollbars',
];

function executable() {
  const found = [process.env.CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'].find((path) => path && fs.existsSync(path));
  if (!found) throw new Error('the browser tests need Chromium: apt-get install chromium, or name one in CHROMIUM');
  return found;
}

/** Opens a browser and a page in it. `faults` collects what the page complains of. */
export async function open(gpu, options = {}) {
  const browser = await chromium.launch({ executablePath: executable(), headless: true, args: [...COMMON, ...GPU[gpu]], timeout: 60_000 });
  const page = await browser.newPage({ viewport: { width: 1000, height: 700 }, ...options });
  page.setDefaultTimeout(60_000);
  const faults = [];
  page.on('pageerror', (error) => faults.push(`pageerror: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error') faults.push(`console: ${message.text()}`);
  });
  return { browser, page, faults };
}

/** Tells the Rust side where the script is; it may act then. */
export const say = (at, more = {}) => console.log(JSON.stringify({ at, ...more }));

/** Waits for a line from the Rust side. */
export function told() {
  return new Promise((resolve) => process.stdin.once('data', (data) => resolve(String(data).trim())));
}

/** Runs a script's body; any error is its failure. */
export async function script(body) {
  try {
    await body(process.argv.slice(2));
    process.exit(0);
  } catch (error) {
    console.error(error.stack ?? String(error));
    process.exit(1);
  }
}

export function check(condition, message) {
  if (!condition) throw new Error(message);
}

/** Loads a package into the page's viewer with a scheme and waits for the complete picture. */
export function load(page, { scheme, filter, src }) {
  return page.evaluate(
    async ([scheme, filter, src]) => {
      const viewer = document.querySelector('kiln-viewer');
      const done = new Promise((resolve, reject) => {
        viewer.addEventListener('load', () => resolve(), { once: true });
        viewer.addEventListener('error', ({ detail }) => reject(new Error(detail.message)), { once: true });
      });
      viewer.removeAttribute('src');
      viewer.mode = 'light-field';
      viewer.scheme = scheme;
      viewer.filter = filter;
      viewer.src = src;
      await done;
      return viewer.stats;
    },
    [scheme, filter, src],
  );
}
