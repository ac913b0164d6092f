// node shaders.mjs URL OUT: every shader that the viewer compiles, complete, as OUT/NAME.vert and OUT/NAME.frag. The text comes out of the
// bundle that is served.
import fs from 'node:fs';
import path from 'node:path';
import { check, open, say, script } from './browser.mjs';

await script(async ([url, out]) => {
  const { browser, page } = await open('swiftshader');
  await page.goto(url);
  const variants = await page.evaluate(async () => (await import(new URL('kiln-viewer.js', document.baseURI).href)).shaderVariants());
  for (const { name, stage, source } of variants) fs.writeFileSync(path.join(out, `${name}.${stage}`), source);
  check(variants.length > 0, 'the bundle names no shaders');
  say('written', { count: variants.length });
  await browser.close();
});
