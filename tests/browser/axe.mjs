// Accessibility by axe-core: WCAG 2.2 A and AA, and best practices. Serious and critical findings fail.
import fs from 'node:fs';
import { createRequire } from 'node:module';

const SOURCE = fs.readFileSync(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

/** Fails naming every serious fault of the page as it is now. */
export async function checkAccessibility(page, what) {
  // Evaluated by the debugger, not added as a script: the page's Content-Security-Policy would refuse it, as it should.
  await page.evaluate(SOURCE);
  const { violations } = await page.evaluate(() => axe.run(document));
  const serious = violations.filter(({ impact }) => impact === 'serious' || impact === 'critical');
  const told = serious.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ target }) => target.join(' ')).join(', ')}`);
  if (serious.length > 0) throw new Error(`${what}:\n${told.join('\n')}`);
  return violations.map(({ id, impact }) => `${id} (${impact})`);
}
