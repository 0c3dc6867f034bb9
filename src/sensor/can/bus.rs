//! The bus behind its controller: what the controller does for a node, which frames it lets through, the timing of bits, and
//! what is known of it.

use core::fmt;

use super::messages::{ALLOCATION, BATTERY_AUX, BATTERY_INFO, CONTROLLER, TEMPERATURE};
use super::{CanFrame, NodeId, TemperatureMessages};
use crate::announce::{Announce, Limit, Severity};
use crate::parameter::{Parameters, VehicleParameter};

/// A CAN bus, behind a controller that something else serves.
pub trait CanBus {
    /// The next frame that was received, as soon as there is one.
    // The futures stay on one executor, so `Send` need not be promised.
    #[allow(async_fn_in_trait)]
    async fn receive(&self) -> CanFrame;

    /// The next frame that was received, if there is one already.
    fn try_receive(&self) -> Option<CanFrame>;

    /// Has a frame sent, as soon as there is room. If the future is dropped before, it is not.
    #[allow(async_fn_in_trait)]
    async fn send(&self, frame: CanFrame);

    /// Lets nothing else through, as far as the controller can; nothing works before.
    fn accept(&self, accepted: Acceptance);

    /// State of the controller.
    fn status(&self) -> CanStatus;
}

/// Filters of a controller: frames that pass the filters of one of its two receive buffers.
///
/// A frame for the first buffer goes to the second while the first is full. A frame for the second is lost while that is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acceptance {
    /// Filters of the first buffer.
    pub first: CanFilters<2>,
    /// Filters of the second buffer.
    pub second: CanFilters<4>,
}

/// Filters of a receive buffer. A frame passes if its identifier is extended and agrees with one of `ids` in all bits of `mask`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanFilters<const N: usize> {
    /// Bits that have to agree, of 29.
    pub mask: u32,
    /// Identifiers.
    pub ids: [u32; N],
}

/// The type of a message, and the bit that it is not a service.
const TYPE: u32 = 0x00ff_ff80;

/// In which bits of the identifier BatteryInfo and BatteryInfoAux differ.
const BATTERY_BITS: u32 = ((BATTERY_INFO ^ BATTERY_AUX) as u32) << TYPE_SHIFT;

/// The lowest two bits of the type, and whether it is a service: all that an anonymous message has.
const LOWEST_TYPE_BITS: u32 = 0x380;

/// Place of the type of a message.
const TYPE_SHIFT: u32 = 8;

/// Bit of a service, and where its destination stands.
const SERVICE: u32 = 0x80;
const DESTINATION_SHIFT: u32 = 8;

/// The filters in use.
///
/// Frequent messages in transfers of several frames have both buffers: batteries, both messages by one filter, and motor
/// controllers. This lets StaticPressure (1028), gnss.Fix (1060) and BatteryContinuous (20010) through as well, but no commands
/// for motor controllers. What is left has the second: messages with the lowest two type bits of Allocation, which are also those
/// of NodeStatus and of a charger, services for nodes with the lowest two bits of the own id, and thermometers if there are any.
pub(super) fn acceptance(own_id: Option<NodeId>, temperatures: TemperatureMessages) -> Acceptance {
    let lowest = |type_id: u16| u32::from(type_id & 3) << TYPE_SHIFT;
    let messages = lowest(ALLOCATION);
    let thermometers = match temperatures {
        TemperatureMessages::Ignored => messages,
        TemperatureMessages::Wanted => lowest(TEMPERATURE),
    };
    let services = own_id.map(|id| u32::from(id.number() & 3) << DESTINATION_SHIFT | SERVICE);
    let services = services.unwrap_or(messages);
    Acceptance {
        first: CanFilters {
            mask: TYPE & !BATTERY_BITS,
            ids: [BATTERY_INFO, CONTROLLER].map(|type_id| u32::from(type_id) << TYPE_SHIFT),
        },
        second: CanFilters {
            mask: LOWEST_TYPE_BITS,
            // A filter can't be left out.
            ids: [messages, services, thermometers, services],
        },
    }
}

impl<const N: usize> CanFilters<N> {
    /// Whether a frame with this extended identifier passes.
    #[cfg(test)]
    pub fn pass(&self, id: u32) -> bool {
        self.ids.iter().any(|own| (own ^ id) & self.mask == 0)
    }
}

/// Quanta of a bit after which a controller samples it at 87.5 %, where DroneCAN wants it.
const USUAL_QUANTA: u32 = 16;

/// At least this many quanta make a bit (MCP2515 data sheet DS20001801, 5.1). With two for phase segment 2 it is sampled at 75 %.
const FEWEST_QUANTA: u32 = 8;

/// A quantum is two or more periods of the crystal, by a prescaler of 1 to 64 (DS20001801, 5.1).
const PERIODS: u32 = 2;
const HIGHEST_PRESCALER: u32 = 64;

/// Division of a bit on the bus, for a controller whose quanta are multiples of two periods of its crystal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    quanta: u8,
    prescaler: u8,
}

impl BitTiming {
    /// The timing of bits at `bit_rate` with a crystal of `crystal_mhz`; `None` if the crystal is too slow for that rate, or
    /// their ratio is odd.
    pub fn new(crystal_mhz: u32, bit_rate: u32) -> Option<Self> {
        let quantum_periods = crystal_mhz.checked_mul(1_000_000 / PERIODS)?;
        let whole = quantum_periods.checked_rem(bit_rate)? == 0;
        let periods = quantum_periods.checked_div(bit_rate).filter(|_| whole)?;
        let quanta = match periods {
            FEWEST_QUANTA => FEWEST_QUANTA,
            _ if periods.is_multiple_of(USUAL_QUANTA) => USUAL_QUANTA,
            _ => return None,
        };
        let prescaler = periods / quanta;
        (1..=HIGHEST_PRESCALER).contains(&prescaler).then_some(Self {
            quanta: quanta as u8,
            prescaler: prescaler as u8,
        })
    }

    /// The timing that the parameters call for; `None` if the bus is not in use.
    ///
    /// # Errors
    /// The crystal is too slow for the bit rate.
    pub fn from_parameters(parameters: &Parameters) -> Result<Option<Self>, CanReport> {
        let whole = |parameter: VehicleParameter| parameters.get_whole(parameter).unsigned_abs();
        if whole(VehicleParameter::CanP1Driver) == 0 {
            return Ok(None);
        }
        let timing = Self::new(
            whole(VehicleParameter::CanP1Crystal),
            whole(VehicleParameter::CanP1Bitrate),
        );
        timing.map(Some).ok_or(CanReport::ImpossibleBitRate)
    }

    /// Quanta of a bit, 8 or 16: the first synchronises, the last two are phase segment 2.
    pub fn quanta(self) -> u8 {
        self.quanta
    }

    /// Double periods of the crystal in a quantum, 1 to 64.
    pub fn prescaler(self) -> u8 {
        self.prescaler
    }
}

/// State of the controller and its bus. Numbers count since the start, modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CanStatus {
    /// Whether it takes part in the bus.
    pub state: CanState,
    /// Whether it interrupts as it should.
    pub interrupt: CanInterrupt,
    /// Number of times it was bus-off.
    pub bus_offs: u32,
    /// Number of times it had lost its configuration and was configured again.
    pub lost_setups: u32,
    /// Received frames that were lost, at least: the controller or the queue behind it had no room.
    pub lost_frames: u32,
    /// Frames that were discarded as they could not be sent.
    pub unsent_frames: u32,
    /// Looks at the controller: without more of them what serves it stands still.
    pub looks: u32,
}

impl CanStatus {
    /// Before the controller is set up.
    pub const STARTING: Self = Self {
        state: CanState::Starting,
        interrupt: CanInterrupt::Working,
        bus_offs: 0,
        lost_setups: 0,
        lost_frames: 0,
        unsent_frames: 0,
        looks: 0,
    };
}

/// Whether the controller takes part in the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanState {
    /// It is not set up yet.
    Starting,
    /// It does not answer.
    NoAnswer,
    /// It takes part.
    Active,
    /// It takes part, but there were too many errors: an error counter is above 127 (ISO 11898-1).
    Passive,
    /// It takes no part: its transmit error counter has passed 255 (ISO 11898-1), or the bus is never idle.
    BusOff,
}

/// Whether the controller interrupts when there is something to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanInterrupt {
    /// As far as is known.
    Working,
    /// The line is open or stuck: the controller is looked at at intervals.
    Dead,
}

/// Announced form of the controller's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum CanReport {
    /// The crystal is too slow for the bit rate.
    ImpossibleBitRate,
    /// The controller does not answer.
    NoAnswer,
    /// The controller had lost its configuration, and was configured again.
    Reconfigured,
    /// There are too many errors.
    Passive,
    /// Number of times the controller was bus-off since the start.
    BusOff(u32),
    /// The bus works again.
    Working,
    /// The interrupt line is open or stuck.
    NoInterrupt,
    /// This many received frames were lost since the start.
    FramesLost(u32),
}

impl Announce for CanReport {
    fn severity(&self) -> Severity {
        Severity::of_fault(*self != Self::Working)
    }

    fn limit(&self) -> Limit {
        Limit::of(self).one_at_once()
    }
}

impl fmt::Display for CanReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ImpossibleBitRate => f.write_str("CAN off: 1 Mbit/s needs a 16 MHz crystal"),
            Self::NoAnswer => f.write_str("CAN controller does not answer"),
            Self::Reconfigured => f.write_str("CAN controller was reset and configured again"),
            Self::Passive => f.write_str("CAN bus has errors: check wires and bit rate"),
            Self::BusOff(times) => write!(f, "CAN bus off, times: {times}"),
            Self::Working => f.write_str("CAN bus works"),
            Self::NoInterrupt => f.write_str("CAN interrupt line GP17 does not work"),
            Self::FramesLost(frames) => write!(f, "CAN frames lost: {frames}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn every_rate_of_the_parameter_has_its_timing() {
        for (crystal_mhz, bit_rate, expected) in [
            (16, 1_000_000, Some((8, 1))),
            (16, 500_000, Some((16, 1))),
            (16, 250_000, Some((16, 2))),
            (16, 125_000, Some((16, 4))),
            (8, 1_000_000, None),
            (8, 500_000, Some((8, 1))),
            (8, 250_000, Some((16, 1))),
            (8, 125_000, Some((16, 2))),
        ] {
            let timing = BitTiming::new(crystal_mhz, bit_rate);
            let timing = timing.map(|timing| (timing.quanta(), timing.prescaler()));
            assert_eq!(timing, expected, "{crystal_mhz} MHz, {bit_rate} bit/s");
        }
    }

    #[test]
    fn a_slow_crystal_is_refused_with_the_reason() {
        let timing = BitTiming::from_parameters;
        let mut parameters = Parameters::defaults();
        assert_eq!(timing(&parameters), Ok(None));
        parameters.set(VehicleParameter::CanP1Driver, 1.0).unwrap();
        assert_eq!(timing(&parameters), Ok(BitTiming::new(16, 1_000_000)));
        parameters.set(VehicleParameter::CanP1Crystal, 8.0).unwrap();
        assert_eq!(timing(&parameters), Err(CanReport::ImpossibleBitRate));
        parameters.set(VehicleParameter::CanP1Bitrate, 500_000.0).unwrap();
        assert_eq!(timing(&parameters), Ok(BitTiming::new(8, 500_000)));
    }

    proptest! {
        /// Whatever is set, there is a timing of exactly that rate or none.
        #[test]
        fn timing_is_exact(crystal_mhz: u32, bit_rate: u32) {
            if let Some(timing) = BitTiming::new(crystal_mhz, bit_rate) {
                let periods = u64::from(timing.quanta()) * u64::from(timing.prescaler()) * 2;
                prop_assert_eq!(periods * u64::from(bit_rate), u64::from(crystal_mhz) * 1_000_000);
                prop_assert!((1..=64).contains(&timing.prescaler()) && [8, 16].contains(&timing.quanta()));
            }
        }
    }

    /// Of one STATUSTEXT.
    const TEXT_BYTES: usize = 50;

    #[test]
    fn texts_fit_one_message() {
        for report in [
            CanReport::ImpossibleBitRate,
            CanReport::Reconfigured,
            CanReport::Passive,
            CanReport::BusOff(u32::MAX),
            CanReport::NoInterrupt,
            CanReport::FramesLost(u32::MAX),
        ] {
            assert!(report.to_string().len() <= TEXT_BYTES, "{report}");
        }
    }
}
