//! Who may write to flash.

use core::cell::Cell;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::waitqueue::GenericAtomicWaker;

/// At least as many as there are tasks that write to flash: parameters, signing, learnt.
const WAITING: usize = 4;

/// Turns at the flash chip, in the order in which they are asked for.
///
/// A mutex would be taken by the task that has just released it and comes again, before the one that is woken has run. So
/// one that always has something to write would keep the others waiting until the watchdog misses them.
pub(super) struct FlashTurns {
    asked: Cell<u32>,
    over: Cell<u32>,
    waiting: [GenericAtomicWaker<NoopRawMutex>; WAITING],
}

impl FlashTurns {
    pub const fn new() -> Self {
        Self {
            asked: Cell::new(0),
            over: Cell::new(0),
            waiting: [const { GenericAtomicWaker::new(NoopRawMutex::new()) }; WAITING],
        }
    }

    /// Waits until all turns that were asked for before are over.
    pub async fn next(&self) -> FlashTurn<'_> {
        let number = self.asked.get();
        self.asked.set(number.wrapping_add(1));
        let turn = FlashTurn(self);
        poll_fn(|context| {
            let ahead = number.wrapping_sub(self.over.get()).cast_signed();
            if ahead <= 0 {
                return Poll::Ready(());
            }
            if let Some(waiting) = self.waiting_for(number) {
                waiting.register(context.waker());
            }
            Poll::Pending
        })
        .await;
        turn
    }

    fn waiting_for(&self, number: u32) -> Option<&GenericAtomicWaker<NoopRawMutex>> {
        self.waiting.get(number as usize % WAITING)
    }
}

/// A turn, until it is dropped. One that is given up before it has come is over, too.
pub(super) struct FlashTurn<'a>(&'a FlashTurns);

impl Drop for FlashTurn<'_> {
    fn drop(&mut self) {
        let next = self.0.over.get().wrapping_add(1);
        self.0.over.set(next);
        if let Some(waiting) = self.0.waiting_for(next) {
            waiting.wake();
        }
    }
}

#[cfg(test)]
mod tests {
    use embassy_futures::select::{select, select3};
    use embassy_futures::{block_on, yield_now};

    use super::*;

    /// Writes whenever it may, as often as that is.
    async fn write_for_ever(turns: &FlashTurns, count: &Cell<u32>, others: &Cell<u32>) {
        while count.get() < 100 {
            assert!(count.get() <= others.get() + 2, "{count:?} to {others:?}");
            let _turn = turns.next().await;
            yield_now().await;
            count.set(count.get() + 1);
        }
    }

    #[test]
    fn tasks_that_always_have_something_to_write_take_turns() {
        let turns = FlashTurns::new();
        let [parameters, signing, learnt] = [const { Cell::new(0) }; 3];
        block_on(select3(
            write_for_ever(&turns, &parameters, &signing),
            write_for_ever(&turns, &signing, &learnt),
            write_for_ever(&turns, &learnt, &parameters),
        ));
    }

    #[test]
    fn a_turn_that_is_given_up_keeps_no_other_waiting() {
        let turns = FlashTurns::new();
        block_on(async {
            let first = turns.next().await;
            select(turns.next(), yield_now()).await;
            drop(first);
            turns.next().await;
        });
    }
}
