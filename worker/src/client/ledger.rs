//! What the worker still owes, and whether it may take on more.
//!
//! Tracing and delivery are decoupled: while the chunks of one lease are on their way the next one is being traced. Two rules keep that from
//! doing harm. At most one finished lease may be under way, so that a worker with a slow link does not hoard tiles. And nothing new is
//! leased while an attempt may have expired with chunks undelivered, or while chunks of an earlier worker lie in the spool: the coordinator
//! would lease out the very tiles that lie finished here, to this worker first of all. A lease that is asked for in spite of it all costs
//! duplicates, never a wrong byte, so the rules need not be watertight.

use kiln_proto::ids::Token;
use std::{collections::BTreeMap, sync::Arc};
use tokio::sync::watch;

/// Finished attempts that may be under way while the next is leased.
const UNDER_WAY: usize = 1;

/// A handle to the account; clones share it.
#[derive(Debug, Clone)]
pub struct Ledger(Arc<watch::Sender<Account>>);

#[derive(Debug, Default)]
struct Account {
    /// Chunks of earlier workers that have no verdict.
    inherited: usize,
    /// Attempts whose end the coordinator has not been told, and whether each may have expired.
    open: BTreeMap<Token, bool>,
}

impl Account {
    fn may_lease(&self) -> bool {
        self.inherited == 0 && self.open.len() <= UNDER_WAY && !self.open.values().any(|doubtful| *doubtful)
    }
}

impl Ledger {
    /// An account with this many chunks of earlier workers.
    #[must_use]
    pub fn new(inherited: usize) -> Self {
        Self(Arc::new(watch::Sender::new(Account { inherited, ..Account::default() })))
    }

    /// An attempt begins.
    pub fn open(&self, token: Token) {
        self.0.send_modify(|account| {
            account.open.insert(token, false);
        });
    }

    /// The coordinator has heard of the attempt.
    pub fn alive(&self, token: Token) {
        self.mark(token, false);
    }

    /// The attempt may have expired, or has.
    pub fn doubtful(&self, token: Token) {
        self.mark(token, true);
    }

    fn mark(&self, token: Token, doubtful: bool) {
        self.0.send_if_modified(|account| account.open.get_mut(&token).is_some_and(|mark| std::mem::replace(mark, doubtful) != doubtful));
    }

    /// Everything of the attempt has been delivered and told.
    pub fn close(&self, token: Token) {
        self.0.send_modify(|account| {
            account.open.remove(&token);
        });
    }

    /// A chunk of an earlier worker has its verdict.
    pub fn settled_inherited(&self) {
        self.0.send_modify(|account| account.inherited = account.inherited.saturating_sub(1));
    }

    /// Resolves when the next lease may be asked for.
    pub async fn may_lease(&self) {
        // The sender lives as long as this handle: the wait cannot fail.
        let _ = self.0.subscribe().wait_for(Account::may_lease).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    /// Whether a future is ready at its first poll.
    fn ready(future: impl Future<Output = ()>) -> bool {
        let mut context = std::task::Context::from_waker(std::task::Waker::noop());
        std::pin::pin!(future).as_mut().poll(&mut context).is_ready()
    }

    #[test]
    fn one_lease_may_be_under_way_while_the_next_is_traced() {
        let ledger = Ledger::new(0);
        let (a, b) = (Token::random(), Token::random());
        assert!(ready(ledger.may_lease()));
        ledger.open(a);
        assert!(ready(ledger.may_lease()));
        ledger.open(b);
        assert!(!ready(ledger.may_lease()), "two are under way");
        ledger.close(a);
        assert!(ready(ledger.may_lease()));
    }

    #[test]
    fn nothing_is_leased_while_an_attempt_may_have_expired() {
        let ledger = Ledger::new(0);
        let token = Token::random();
        ledger.open(token);
        ledger.doubtful(token);
        assert!(!ready(ledger.may_lease()));
        ledger.alive(token);
        assert!(ready(ledger.may_lease()), "it was heard in time");
        ledger.doubtful(token);
        ledger.close(token);
        assert!(ready(ledger.may_lease()), "everything is delivered");
        ledger.doubtful(token);
        assert!(ready(ledger.may_lease()), "a late heartbeat of a closed attempt means nothing");
    }

    #[test]
    fn what_an_earlier_worker_left_goes_first() {
        let ledger = Ledger::new(2);
        ledger.settled_inherited();
        assert!(!ready(ledger.may_lease()));
        ledger.settled_inherited();
        assert!(ready(ledger.may_lease()));
    }
}
