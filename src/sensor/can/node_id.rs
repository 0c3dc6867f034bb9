//! Ids of nodes.

use core::num::NonZeroU8;

/// Highest node id (DroneCAN specification, 4. CAN bus transport layer).
const HIGHEST: u8 = 127;

/// Id of a node, unique on the bus: 1 to 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(NonZeroU8);

impl NodeId {
    /// The id with this number; `None` for 0, which stands for a node without an id, and above 127.
    pub fn new(number: u8) -> Option<Self> {
        NonZeroU8::new(number).filter(|_| number <= HIGHEST).map(Self)
    }

    /// The number, 1 to 127.
    pub fn number(self) -> u8 {
        self.0.get()
    }
}

#[cfg(target_os = "none")]
impl defmt::Format for NodeId {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}", self.number());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_1_to_127() {
        let valid: Vec<u8> = (0..=u8::MAX)
            .filter_map(NodeId::new)
            .map(NodeId::number)
            .collect();
        assert_eq!(valid, (1..=127).collect::<Vec<u8>>());
    }
}
