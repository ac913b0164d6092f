import { describe, expect, it } from 'vitest';
import { type Costs, fitBudget } from './budget.ts';

const cost = (mean: number, streamed: number | null, expanded: number | null, raw: number | null = null): Costs => ({ mean, streamed, expanded, raw });
const used = (costs: Costs[], budget: number) => fitBudget(costs, budget, 'auto').reduce((sum, s, i) => sum + costs[i][s!]!, 0);

describe('a memory budget', () => {
  const costs = [cost(1, 10, 100), cost(2, 20, 60), cost(1, 5, 1000)];

  it('expands what fits and streams the rest', () => {
    expect(fitBudget(costs, 2000, 'auto')).toEqual(['expanded', 'expanded', 'expanded']);
    expect(fitBudget(costs, 170, 'auto')).toEqual(['expanded', 'expanded', 'streamed']);
    expect(fitBudget(costs, 80, 'auto')).toEqual(['streamed', 'expanded', 'streamed']);
    expect(fitBudget(costs, 74, 'auto')).toEqual(['streamed', 'streamed', 'streamed']);
    expect(fitBudget(costs, 17, 'auto')).toEqual(['streamed', 'mean', 'streamed']);
    expect(fitBudget(costs, 0, 'auto')).toEqual(['mean', 'mean', 'mean']);
  });

  it('is kept wherever even the means fit', () => {
    for (let budget = 4; budget < 1300; budget += 7) expect(used(costs, budget)).toBeLessThanOrEqual(budget);
  });

  it('cannot choose what a surface does not have', () => {
    expect(fitBudget([cost(1, null, 50)], 49, 'auto')).toEqual(['mean']);
    expect(fitBudget([cost(1, null, 50), cost(1, 3, null)], 1000, 'streamed')).toEqual(['expanded', 'streamed']);
    expect(fitBudget(costs, 2000, 'raw')).toEqual(['expanded', 'expanded', 'expanded']);
  });

  it('streams what is too large for a mean, and leaves out what is too large for everything', () => {
    const large = { mean: null, streamed: 9, expanded: null, raw: null };
    const hopeless = { mean: null, streamed: null, expanded: null, raw: null };
    expect(fitBudget([large, hopeless], 1, 'auto')).toEqual(['streamed', null]);
  });
});
