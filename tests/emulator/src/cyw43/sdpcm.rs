//! F2: the packets between the driver and the WLAN core's program: SDPCM around control messages, events and frames,
//! with a sequence number and credits in each.

/// Without a control, event or data header behind it, it brings credits only.
const HEADER_BYTES: usize = 12;
/// BDC: version 2 in the upper half of the first byte, and in the last how many words follow before the content.
const BDC_BYTES: usize = 4;
const BDC_VERSION: u8 = 2 << 4;
/// This many packets the driver may send before it hears of the next ones.
const CREDITS: u8 = 16;
/// When it has fewer than that, it hears of more.
const FEW_CREDITS: u8 = 4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    Control = 0,
    Event = 1,
    Data = 2,
}

/// A packet from the driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Received {
    Control(Vec<u8>),
    Frame(Vec<u8>),
}

/// A packet for the driver, before it has its header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    pub channel: Channel,
    pub content: Vec<u8>,
}

impl Packet {
    pub fn control(content: Vec<u8>) -> Self {
        Self {
            channel: Channel::Control,
            content,
        }
    }

    pub fn event(content: &[u8]) -> Self {
        Self::behind_bdc(Channel::Event, content)
    }

    pub fn frame(content: &[u8]) -> Self {
        Self::behind_bdc(Channel::Data, content)
    }

    fn behind_bdc(channel: Channel, content: &[u8]) -> Self {
        let header = [BDC_VERSION, 0, 0, 0];
        Self {
            channel,
            content: [&header, content].concat(),
        }
    }

    /// With its header.
    pub fn bytes(&self) -> usize {
        HEADER_BYTES + self.content.len()
    }
}

/// Sequence numbers and credits.
#[derive(Clone, Debug)]
pub struct Sdpcm {
    /// Of the next packet to the driver.
    sequence: u8,
    /// Of the next packet from the driver.
    expected: u8,
    /// Up to which the driver may send, as it was last informed.
    credit: u8,
}

impl Sdpcm {
    /// The driver may send one packet unasked.
    pub fn new() -> Self {
        Self {
            sequence: 0,
            expected: 0,
            credit: 1,
        }
    }

    /// A packet as the driver reads it.
    pub fn framed(&mut self, packet: &Packet) -> Vec<u8> {
        let length = packet.bytes() as u16;
        self.credit = self.expected.wrapping_add(CREDITS);
        let mut bytes = Vec::with_capacity(packet.bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend((!length).to_le_bytes());
        bytes.extend([self.sequence, packet.channel as u8, 0, HEADER_BYTES as u8]);
        bytes.extend([0, self.credit, 0, 0]);
        bytes.extend(&packet.content);
        self.sequence = self.sequence.wrapping_add(1);
        bytes
    }

    /// The driver can send few packets more.
    pub fn has_few_credits(&self) -> bool {
        self.credit.wrapping_sub(self.expected) < FEW_CREDITS
    }

    /// What the driver has sent; `None`: nothing that can be understood.
    pub fn received(&mut self, bytes: &[u8]) -> Option<Received> {
        let header = bytes.get(..HEADER_BYTES)?;
        let half = |index: usize| u16::from_le_bytes([header[index], header[index + 1]]);
        let (length, complement) = (half(0), half(2));
        if length != !complement {
            return None;
        }
        self.expected = header[4].wrapping_add(1);
        let content = bytes.get(usize::from(header[7])..usize::from(length))?;
        match header[5] & 0x0f {
            channel if channel == Channel::Control as u8 => Some(Received::Control(content.to_vec())),
            channel if channel == Channel::Data as u8 => frame(content).map(Received::Frame),
            _ => None,
        }
    }
}

/// What is behind a BDC header.
fn frame(content: &[u8]) -> Option<Vec<u8>> {
    let start = BDC_BYTES + 4 * usize::from(*content.get(BDC_BYTES - 1)?);
    content.get(start..).map(<[u8]>::to_vec)
}
