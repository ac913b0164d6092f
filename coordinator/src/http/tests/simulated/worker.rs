//! A worker: the real session, heartbeat, chunks, spool, outbox, courier and ledger, with somebody who bakes nothing between them.
//!
//! What is left out is `run`, which traces light on threads of its own. The order of what it does is kept: lease when the ledger allows it,
//! a heartbeat from the grant to the end, chunks into the outbox, the end behind the last one.

use super::{
    net::{COORDINATOR, SimulatedCarrier},
    witness::Witness,
};
use crate::{engine::tests::segment, lease::simulation::Dice};
use kiln_proto::{
    BAKE_VERSION,
    ids::Digest,
    tile::TileIndex,
    wire::message::{Finish, Hello, LeaseGrant, Phase},
};
use kiln_worker::client::{
    attempt::{Attempt, Heart},
    courier::Courier,
    ledger::Ledger,
    outbox::Outbox,
    session::Session,
    spool::Spool,
    stream::{Chunk, Packed},
};
use std::{
    path::PathBuf,
    sync::Arc,
    time::{Duration, Instant, SystemTime},
};
use tokio_util::sync::CancellationToken;

/// Who a worker is.
pub(super) struct Person {
    pub(super) name: String,
    pub(super) dice: Dice,
    /// Where its spool is, from one life to the next.
    pub(super) spool: PathBuf,
    /// The longest that a tile takes it, milliseconds.
    pub(super) pace: u64,
    /// The plan that it has.
    pub(super) plan: Option<Digest>,
    /// Where it is not 0: bakes bytes of its own, other than everybody else's.
    pub(super) lie: u64,
    pub(super) witness: Arc<Witness>,
}

/// The light of a tile: that which honest workers agree on, or a liar's.
pub(super) fn light(tile: u64, lie: u64) -> f32 {
    tile as f32 * 0.25 + lie as f32 * 1_000.0
}

/// What a worker holds.
struct Desk {
    session: Arc<Session>,
    outbox: Outbox,
    ledger: Ledger,
}

/// Works until the host dies; the only other end is an error.
pub(super) async fn live(mut me: Person) -> turmoil::Result {
    let (spool, inherited) = Spool::open(&me.spool, "farm", 1 << 20, SystemTime::now())?;
    if !inherited.is_empty() {
        me.witness.meet("chunks of an earlier life");
    }
    let carrier = Box::new(SimulatedCarrier::new(&me.name, Arc::clone(&me.witness)));
    let hello = Hello { bake_version: BAKE_VERSION, name: me.name.clone(), threads: 1, features: vec![] };
    let session = Session::through(carrier, format!("http://{COORDINATOR}"), hello, CancellationToken::new()).await?;
    let session = Arc::new(session);
    let (courier, outbox, ledger) = Courier::new(Arc::clone(&session), Some(spool), inherited);
    let desk = Desk { session, outbox, ledger };
    tokio::select! {
        ended = courier.run() => Err(format!("the courier of {} ended: {ended:?}", me.name).into()),
        ended = me.work(&desk) => ended,
    }
}

impl Person {
    async fn work(&mut self, desk: &Desk) -> turmoil::Result {
        loop {
            desk.ledger.may_lease().await;
            match desk.session.lease().await {
                Ok(Some(grant)) => self.attempt(desk, grant).await?,
                Ok(None) => {}
                // A coordinator that is away.
                Err(_) => tokio::time::sleep(Duration::from_millis(200 + self.dice.roll(800))).await,
            }
        }
    }

    async fn attempt(&mut self, desk: &Desk, grant: LeaseGrant) -> turmoil::Result {
        let attempt = Arc::new(Attempt::new(grant.token));
        desk.ledger.open(grant.token);
        let heart = Heart::start(Arc::clone(&desk.session), Arc::clone(&attempt), desk.ledger.clone());
        let whole = self.bake(desk, &grant, &attempt).await?;
        let finish = Finish { core_seconds: 1.0, rays: attempt.rays(), peak_rss_bytes: 1, failure: None };
        Ok(desk.outbox.end(attempt, finish, whole, heart)?)
    }

    /// Whether every tile was handed in.
    async fn bake(&mut self, desk: &Desk, grant: &LeaseGrant, attempt: &Arc<Attempt>) -> Result<bool, Box<dyn std::error::Error>> {
        if self.plan.replace(grant.plan) != Some(grant.plan) {
            desk.session.plan(grant.plan).await?;
        }
        // A probe looks at a few texels.
        let pace = if grant.phase == Phase::Probe { self.pace / 8 } else { self.pace };
        let (mut chunk, mut number, mut whole) = (Chunk::default(), 0, true);
        for tile in grant.tiles.start..grant.tiles.end {
            if attempt.is_over() || self.dice.once_in(60) {
                whole = false;
                break;
            }
            tokio::time::sleep(Duration::from_millis(20 + self.dice.roll(pace))).await;
            chunk.push(&Packed::new(TileIndex(tile), &segment(grant.phase, tile, light(tile, self.lie)))?, Instant::now());
            attempt.did(1_024, 1_000);
            if self.dice.once_in(2) {
                desk.outbox.chunk(attempt, number, chunk.close()?.0).await?;
                number += 1;
            }
        }
        if !chunk.is_empty() {
            desk.outbox.chunk(attempt, number, chunk.close()?.0).await?;
        }
        Ok(whole)
    }
}
