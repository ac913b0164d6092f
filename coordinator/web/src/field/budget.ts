/**
 * Which scheme each surface gets under a budget of texture memory.
 *
 * Expanded samples draw an order of magnitude faster than streams and take several times their memory; the mean alone takes almost nothing
 * and does not move with the camera. Every surface starts at the cheapest scheme, and what is left of the budget buys first streams for
 * all, then expansions, the cheapest step first: most surfaces end at the best scheme. Weighing by area on the screen was tried on paper
 * and left out: a scheme that changes as the camera moves costs more than it saves.
 */

import type { Scheme } from '../viewer/api.ts';

/** Bytes of a surface under each scheme; null where the GPU or the data does not allow it. */
export type Costs = Record<Scheme, number | null>;

const RANK: Scheme[] = ['mean', 'streamed', 'expanded'];

/**
 * The scheme of each surface, null where none is possible. `wanted` forces one whatever the budget; a surface that cannot have it gets what
 * it would have had by itself.
 */
export function fitBudget(costs: Costs[], budget: number, wanted: 'auto' | Scheme): (Scheme | null)[] {
  if (wanted !== 'auto') {
    const auto = fitBudget(costs, budget, 'auto');
    return costs.map((cost, i) => (cost[wanted] === null ? auto[i] : wanted));
  }
  // A surface too large for a mean is streamed from the start.
  const chosen = costs.map((cost) => RANK.find((scheme) => cost[scheme] !== null) ?? null);
  const cost = (i: number): number => (chosen[i] && costs[i][chosen[i]]) ?? 0;
  let used = costs.reduce((sum, _, i) => sum + cost(i), 0);
  for (const scheme of RANK.slice(1)) {
    const steps = costs
      .map((own, i) => ({ i, to: own[scheme], from: cost(i) }))
      .filter((step): step is { i: number; to: number; from: number } => step.to !== null && chosen[step.i] !== scheme)
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
