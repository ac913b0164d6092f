/**
 * Which scheme each surface gets under a budget of texture memory.
 *
 * Expanded samples draw an order of magnitude faster than streams and take several times their memory; the mean alone takes almost nothing
 * and does not move with the camera. Every surface starts at the cheapest scheme, and what is left of the budget buys first streams for all,
 * then expansions, the cheapest step first: most surfaces end at the best scheme. Weighing by area on the screen was tried on paper and left
 * out: a scheme that changes as the camera moves costs more than it saves.
 */

import type { Scheme } from '../viewer/api.ts';

/** Bytes of a surface under each scheme; null where the GPU or the data does not allow it. */
export type Costs = Record<Scheme, number | null>;

const RANK: Scheme[] = ['mean', 'streamed', 'expanded'];

/** The scheme of each surface. `wanted` forces one for all, as far as a surface allows it, whatever the budget. */
export function fitBudget(costs: Costs[], budget: number, wanted: 'auto' | Scheme): Scheme[] {
  if (wanted !== 'auto') return costs.map((cost) => (cost[wanted] === null ? 'mean' : wanted));
  const chosen: Scheme[] = costs.map(() => 'mean');
  let used = costs.reduce((sum, cost) => sum + (cost.mean ?? 0), 0);
  for (const scheme of RANK.slice(1)) {
    const steps = costs
      .map((cost, i) => ({ i, to: cost[scheme], from: cost[chosen[i]] ?? 0 }))
      .filter((step): step is { i: number; to: number; from: number } => step.to !== null)
      .sort((a, b) => a.to - a.from - (b.to - b.from) || a.i - b.i);
    for (const { i, to, from } of steps) {
      if (used + to - from <= budget) {
        used += to - from;
        chosen[i] = scheme;
      }
    }
  }
  return chosen;
}
