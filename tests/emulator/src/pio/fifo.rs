//! The FIFOs between a state machine and the bus (datasheet 3.2.4).

use std::collections::VecDeque;

const DEPTH: usize = 4;

#[derive(Clone, Debug)]
pub struct Fifo {
    words: VecDeque<u32>,
    depth: usize,
}

impl Fifo {
    pub fn new() -> Self {
        Self {
            words: VecDeque::new(),
            depth: DEPTH,
        }
    }

    /// Empties it, and gives it as many times its four places: 0, 1, or 2 when it takes those of the other one, too.
    pub fn set_shares(&mut self, shares: usize) {
        self.words.clear();
        self.depth = shares * DEPTH;
    }

    pub fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    pub fn is_full(&self) -> bool {
        self.words.len() >= self.depth
    }

    pub fn level(&self) -> u32 {
        self.words.len() as u32
    }

    /// Returns whether there was a place.
    pub fn push(&mut self, word: u32) -> bool {
        let has_place = !self.is_full();
        if has_place {
            self.words.push_back(word);
        }
        has_place
    }

    pub fn pop(&mut self) -> Option<u32> {
        self.words.pop_front()
    }
}
