//! Random schedules of leases and chunks against a naive oracle: the store must say of every tile what a plain map says.

use super::*;
use crate::{job::Job, lease::Event as LeaseEvent, store::ChunkOutcome};
use std::collections::BTreeMap;

const TILES: u64 = 30;
/// Leases that something happens to: the last ones, or a job of single tiles would hardly get on among all that are over.
const RECENT: usize = 8;

/// SplitMix64.
fn roll(state: &mut u64, n: u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) % n
}

pub(super) async fn random_schedules_agree_with_the_oracle(store: &dyn Store) {
    let scene = ready_scene(store).await;
    for seed in 0..6u64 {
        let mut dice = seed;
        let job = probing(store, scene, TILES, seed as i32).await;
        let mut now = NOW;
        let (mut leases, mut oracle, mut n) = (Vec::<Grant>::new(), BTreeMap::<TileIndex, Digest>::new(), 0);
        for _ in 0..3_000 {
            now += roll(&mut dice, 15) as i64;
            store.expire(now).await.unwrap();
            // Nobody is connected, so that a tile whose leases ran out three times is given up, and its job with it.
            if matches!(store.job(job).await.unwrap().unwrap().state, Job::Failed { retry: Some(_), .. }) {
                store.job_event(job, &crate::job::Event::Retry, now).await.unwrap().unwrap().unwrap();
            }
            match roll(&mut dice, 4) {
                0 => {
                    let Some(next) = next(store).await else { continue };
                    let end = next.run.end.min(next.run.start + 1 + roll(&mut dice, 5));
                    let lease = grant(job, next.run.start, end, now);
                    let run = store.grant(&[lease], now).await.unwrap()[0].expect("what is pending");
                    leases.push(Grant { run, ..lease });
                }
                1 | 2 if !leases.is_empty() => {
                    let lease = leases[leases.len() - 1 - roll(&mut dice, leases.len().min(RECENT) as u64) as usize];
                    let tile = lease.run.start + roll(&mut dice, lease.run.len());
                    let new = chunk(lease.token, n, &[tile], if roll(&mut dice, 4) == 0 { "other" } else { "" });
                    n += 1;
                    let outcome = store.record_chunk(&new, &oracle, now).await.unwrap();
                    let (at, digest) = (new.tiles[0].tile, new.tiles[0].digest);
                    match outcome {
                        ChunkOutcome::Recorded(row) => {
                            let expected = !oracle.contains_key(&at);
                            assert_eq!(row.accepted.contains(at), expected, "seed {seed}: tile {at} accepted twice, or not at all");
                            assert_eq!(row.conflicts.contains(at), oracle.get(&at).is_some_and(|d| *d != digest), "seed {seed}");
                            oracle.entry(at).or_insert(digest);
                        }
                        ChunkOutcome::Gone(_) => {}
                        ChunkOutcome::NeedDigests(_) => panic!("seed {seed}: tile {at} is done, and nobody did it"),
                    }
                }
                _ if !leases.is_empty() => {
                    let lease = leases[leases.len() - 1 - roll(&mut dice, leases.len().min(RECENT) as u64) as usize];
                    let event = if roll(&mut dice, 2) == 0 { LeaseEvent::Release } else { LeaseEvent::Fence };
                    store.finish_attempt(lease.token, event, None, now).await.unwrap();
                }
                _ => {}
            }
            let done = store.job(job).await.unwrap().unwrap().tiles.1;
            assert_eq!(done, oracle.len() as u64, "seed {seed}");
            if done == TILES {
                break;
            }
        }
        assert_eq!(oracle.len() as u64, TILES, "seed {seed}: the job never ended");
        store.job_event(job, &crate::job::Event::Cancel, now).await.unwrap().unwrap().unwrap();
    }
}
