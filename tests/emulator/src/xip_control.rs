//! XIP_CTRL, the control registers of the cache in front of the flash (datasheet 2.6.3.6).
//!
//! That the cache holds old bytes after an erase or a program is modelled: until it is flushed, a read
//! of flash is a mistake of the firmware. Streaming is not modelled.

use super::clock::Cycle;
use super::peripheral::Peripheral;
use super::register::RegisterWrite;
use super::xip_cache::XipCache;

const CTRL: u32 = 0x00;
const FLUSH: u32 = 0x04;
const STAT: u32 = 0x08;
const STREAM_CTR: u32 = 0x18;

const CTRL_MASK: u32 = 0b1011;
/// Enabled, and bad writes are bus errors.
const CTRL_RESET: u32 = 0b11;
/// Streaming FIFO empty, flush complete.
const STAT_IDLE: u32 = 0b11;

#[derive(Clone)]
pub struct XipControl {
    control: u32,
    /// Flash has changed since the cache was flushed.
    pub is_stale: bool,
    pub cache: XipCache,
}

impl XipControl {
    /// Drop what the cache holds.
    pub fn flush(&mut self) {
        self.is_stale = false;
        self.cache.flush();
    }
}

impl Default for XipControl {
    fn default() -> Self {
        Self {
            control: CTRL_RESET,
            is_stale: false,
            cache: XipCache::default(),
        }
    }
}

impl Peripheral for XipControl {
    /// Reading FLUSH waits for the flush to complete, which it has at once; the counters stay 0.
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            CTRL => self.control,
            STAT => STAT_IDLE,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        match offset {
            CTRL => write.update(&mut self.control, CTRL_MASK),
            FLUSH if write.value & 1 != 0 => self.flush(),
            STREAM_CTR if write.value != 0 => {
                panic!("the firmware streams from flash (XIP_CTRL.STREAM_CTR), which is not modelled")
            }
            _ => {}
        }
    }

    fn reset(&mut self, _now: Cycle) {
        self.control = CTRL_RESET;
        self.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flush_makes_it_fresh() {
        let mut control = XipControl {
            is_stale: true,
            ..XipControl::default()
        };
        control.write(FLUSH, RegisterWrite::plain(0), 0);
        assert!(control.is_stale);
        control.write(FLUSH, RegisterWrite::plain(1), 0);
        assert!(!control.is_stale);
    }

    #[test]
    #[should_panic(expected = "STREAM_CTR")]
    fn streaming_fails_by_name() {
        XipControl::default().write(STREAM_CTR, RegisterWrite::plain(4), 0);
    }
}
