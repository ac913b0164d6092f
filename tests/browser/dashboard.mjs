// node dashboard.mjs URL GPU JOB: the farm's page, with one job that is done and one that waits.
import { checkAccessibility } from './axe.mjs';
import { check, open, say, script } from './browser.mjs';

await script(async ([url, gpu, done, waiting]) => {
  const { browser, page, faults } = await open(gpu);
  await page.goto(`${url}/`);
  const card = (id) => page.locator(`a[href*="jobs/${id}"]`).first();
  await card(done).waitFor();
  await card(waiting).waitFor();
  await page.getByText('rays').first().waitFor();
  const rows = page.locator('#workers').getByRole('row');
  await rows.nth(1).waitFor();
  await page.waitForFunction((id) => [...document.images].some((image) => image.src.includes(id) && image.complete && image.naturalWidth > 0), done);
  say('axe', { minor: await checkAccessibility(page, 'the dashboard') });
  for (const scheme of ['dark', 'light']) {
    await page.emulateMedia({ colorScheme: scheme });
    await checkAccessibility(page, `the dashboard in its ${scheme} colours`);
  }
  // A phone: nothing is wider than the screen.
  await page.setViewportSize({ width: 360, height: 740 });
  check(await page.evaluate(() => document.documentElement.scrollWidth <= 360), 'the dashboard is wider than a narrow screen');
  await page.setViewportSize({ width: 1000, height: 700 });
  // Cancelling asks first, and the keyboard is enough.
  const cancel = page.getByRole('button', { name: /cancel/i }).first();
  const name = (await cancel.getAttribute('aria-label')).replace('Cancel ', '');
  await cancel.focus();
  await page.keyboard.press('Enter');
  const dialog = page.getByRole('dialog');
  await dialog.waitFor();
  await checkAccessibility(page, 'the question');
  await page.keyboard.press('Escape');
  await dialog.waitFor({ state: 'hidden' });
  await page.keyboard.press('Enter');
  await dialog.getByRole('button', { name: /cancel the job|cancel job|yes/i }).press('Enter');
  await page.locator('#jobs .badge').filter({ hasText: /cancelled/i }).waitFor();
  await page.getByRole('button', { name: `Cancel ${name}`, exact: true }).waitFor({ state: 'hidden' });
  const focus = await page.evaluate(() => document.activeElement.getAttribute('aria-label'));
  check(focus === `Delete ${name}`, `a button that goes leaves the focus at ${focus}`);
  const script = await page.request.get(`${url}/`);
  const policy = script.headers()['content-security-policy'];
  check(/script-src 'self'/.test(policy) && !/unsafe/.test(policy), `the policy allows more than the page's own scripts: ${policy}`);
  check(!/<script(?![^>]*\bsrc=)|\son\w+=|<style|\sstyle=/i.test(await script.text()), 'the page has inline script or style');
  check(faults.length === 0, faults.join('\n'));
  say('ready for the end');
  await page.getByRole('alert').filter({ hasText: 'does not answer since' }).waitFor();
  await browser.close();
});
