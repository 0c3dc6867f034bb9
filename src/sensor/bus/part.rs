//! What a driver has to do.

use super::{Address, SensorBus, Wiring};
use crate::battery::{Measurement, ReadError};

/// A driver of a part on the bus.
pub(super) trait Part: Sized {
    /// What distinguishes the kinds of such a part.
    type Model: 'static;

    /// The time between two readings, in µs. What comes in between two ticks of the battery task is averaged.
    const INTERVAL_US: u64;

    /// The fastest clock it stands, in Hz. The slowest part sets the pace of the bus.
    const HIGHEST_CLOCK_HZ: u32;

    /// Packs it can measure, one on each channel. They share the part if their address is set alike.
    const CHANNELS: usize = 1;

    /// Whether it refuses commands that it does not know: set up while it answers in part, it would lack what it has.
    const REFUSES_COMMANDS: bool = false;

    /// Where to look for it when no address is set.
    fn addresses(model: &'static Self::Model) -> &'static [Address];

    /// Makes sure that what answers is such a part, and prepares it.
    ///
    /// # Errors
    /// No part answers, or it is another one.
    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        wiring: &Wiring,
        model: &'static Self::Model,
    ) -> Result<Self, ReadError>;

    /// Makes sure that it is still the part that was set up, as it was set up. It may have lost its supply, or
    /// another one may be plugged in.
    ///
    /// # Errors
    /// [`ReadError::OtherPart`] if it has to be set up again.
    async fn check(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError>;

    /// One reading of the pack that is wired like this.
    ///
    /// # Errors
    /// The transfer failed, or the part answered nonsense.
    async fn read(&mut self, bus: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError>;
}

/// An I2C part of ordinary speed ("fast mode").
pub(super) const FAST_MODE_HZ: u32 = 400_000;
