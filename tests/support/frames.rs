//! A MAVLink 2 reader for tests, written from the protocol's description and not from the crate the firmware uses, so
//! that both can't make the same mistake.

pub const HEARTBEAT: u32 = 0;
pub const SYS_STATUS: u32 = 1;
pub const SYSTEM_TIME: u32 = 2;
pub const PING: u32 = 4;
pub const SET_MODE: u32 = 11;
pub const PARAM_REQUEST_READ: u32 = 20;
pub const PARAM_REQUEST_LIST: u32 = 21;
pub const PARAM_VALUE: u32 = 22;
pub const PARAM_SET: u32 = 23;
pub const MISSION_COUNT: u32 = 44;
pub const MISSION_ACK: u32 = 47;
pub const REQUEST_DATA_STREAM: u32 = 66;
pub const MANUAL_CONTROL: u32 = 69;
pub const RC_CHANNELS_OVERRIDE: u32 = 70;
pub const COMMAND_INT: u32 = 75;
pub const COMMAND_LONG: u32 = 76;
pub const COMMAND_ACK: u32 = 77;
pub const FILE_TRANSFER_PROTOCOL: u32 = 110;
pub const RADIO_STATUS: u32 = 109;
pub const TIMESYNC: u32 = 111;
pub const LOG_REQUEST_LIST: u32 = 117;
pub const LOG_ENTRY: u32 = 118;
pub const LOG_REQUEST_DATA: u32 = 119;
pub const LOG_DATA: u32 = 120;
pub const LOG_ERASE: u32 = 121;
pub const LOG_REQUEST_END: u32 = 122;
pub const BATTERY_STATUS: u32 = 147;
pub const AUTOPILOT_VERSION: u32 = 148;
pub const MESSAGE_INTERVAL: u32 = 244;
pub const PROTOCOL_VERSION: u32 = 300;
pub const STATUSTEXT: u32 = 253;
pub const SETUP_SIGNING: u32 = 256;
pub const WIFI_CONFIG_AP: u32 = 299;
pub const PARAM_ERROR: u32 = 345;
pub const BATTERY_STATUS_V2: u32 = 369;
pub const SMART_BATTERY_INFO: u32 = 370;
pub const FUEL_STATUS: u32 = 371;
pub const BATTERY_INFO: u32 = 372;
pub const COMPONENT_METADATA: u32 = 397;
pub const NAMED_VALUE_FLOAT: u32 = 251;
pub const AVAILABLE_MODES: u32 = 435;

/// MAV_SEVERITY.
pub const CRITICAL: u8 = 2;

const START_OF_FRAME: u8 = 0xfd;
const HEADER_BYTES: usize = 10;
const CRC_BYTES: usize = 2;
pub const SIGNATURE_BYTES: usize = 6;
/// The link's number, 48 bits of time, the signature.
const TRAILER_BYTES: usize = 7 + SIGNATURE_BYTES;

/// Incompatibility flags: the frame is signed.
const SIGNED: u8 = 1;

/// A frame whose checksum is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// When its last byte had arrived, in µs.
    pub at_us: u64,
    pub sequence: u8,
    pub system_id: u8,
    pub component_id: u8,
    pub message_id: u32,
    /// Without the zeros MAVLink 2 cuts off at the end.
    payload: Vec<u8>,
    /// All of a frame that is signed.
    pub signed: Option<Vec<u8>>,
}

impl Frame {
    pub fn payload_len(&self) -> usize {
        self.payload.len()
    }

    fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        core::array::from_fn(|i| self.payload.get(offset + i).copied().unwrap_or(0))
    }

    pub fn u8(&self, offset: usize) -> u8 {
        u8::from_le_bytes(self.bytes(offset))
    }

    pub fn i8(&self, offset: usize) -> i8 {
        i8::from_le_bytes(self.bytes(offset))
    }

    pub fn u16(&self, offset: usize) -> u16 {
        u16::from_le_bytes(self.bytes(offset))
    }

    pub fn i16(&self, offset: usize) -> i16 {
        i16::from_le_bytes(self.bytes(offset))
    }

    pub fn u32(&self, offset: usize) -> u32 {
        u32::from_le_bytes(self.bytes(offset))
    }

    pub fn f32(&self, offset: usize) -> f32 {
        f32::from_le_bytes(self.bytes(offset))
    }

    /// Characters up to the first zero, `length` at most.
    pub fn text(&self, offset: usize, length: usize) -> String {
        (offset..offset + length)
            .map(|at| self.u8(at))
            .take_while(|byte| *byte != 0)
            .map(char::from)
            .collect()
    }

    pub fn i32(&self, offset: usize) -> i32 {
        i32::from_le_bytes(self.bytes(offset))
    }
}

/// The checksum's extra byte of the messages the tests use, from the message definitions.
fn crc_extra(message_id: u32) -> u8 {
    match message_id {
        HEARTBEAT => 50,
        SYS_STATUS => 124,
        PING => 237,
        SYSTEM_TIME => 137,
        SET_MODE => 89,
        PARAM_REQUEST_READ => 214,
        PARAM_REQUEST_LIST => 159,
        PARAM_VALUE => 220,
        PARAM_SET => 168,
        MISSION_COUNT => 221,
        MISSION_ACK => 153,
        REQUEST_DATA_STREAM => 148,
        MANUAL_CONTROL => 243,
        RC_CHANNELS_OVERRIDE => 124,
        COMMAND_INT => 158,
        COMMAND_LONG => 152,
        COMMAND_ACK => 143,
        FILE_TRANSFER_PROTOCOL => 84,
        RADIO_STATUS => 185,
        TIMESYNC => 34,
        LOG_REQUEST_LIST => 128,
        LOG_ENTRY => 56,
        LOG_REQUEST_DATA => 116,
        LOG_DATA => 134,
        LOG_ERASE => 237,
        LOG_REQUEST_END => 203,
        BATTERY_STATUS => 154,
        AUTOPILOT_VERSION => 178,
        MESSAGE_INTERVAL => 95,
        PROTOCOL_VERSION => 217,
        STATUSTEXT => 83,
        SETUP_SIGNING => 71,
        WIFI_CONFIG_AP => 19,
        PARAM_ERROR => 209,
        BATTERY_STATUS_V2 => 145,
        SMART_BATTERY_INFO => 75,
        FUEL_STATUS => 10,
        BATTERY_INFO => 26,
        COMPONENT_METADATA => 182,
        NAMED_VALUE_FLOAT => 170,
        AVAILABLE_MODES => 134,
        other => panic!("message {other} is not one of the tests'"),
    }
}

/// System and component id of a ground station.
pub const GROUND_STATION: [u8; 2] = [255, 190];

/// A ground station's MAVLink 2 frame.
pub fn encode_v2(message_id: u32, payload: &[u8]) -> Vec<u8> {
    encode_v2_from(GROUND_STATION, message_id, payload)
}

/// A MAVLink 2 frame of this system and component.
pub fn encode_v2_from(sender: [u8; 2], message_id: u32, payload: &[u8]) -> Vec<u8> {
    encode(sender, 0, message_id, payload)
}

/// A ground station's MAVLink 2 frame with incompatibility flags.
pub fn encode_v2_with_flags(flags: u8, message_id: u32, payload: &[u8]) -> Vec<u8> {
    encode(GROUND_STATION, flags, message_id, payload)
}

fn encode([system_id, component_id]: [u8; 2], flags: u8, message_id: u32, payload: &[u8]) -> Vec<u8> {
    let used = payload
        .iter()
        .rposition(|byte| *byte != 0)
        .map_or(1, |last| last + 1);
    let id = message_id.to_le_bytes();
    let mut frame = vec![
        START_OF_FRAME,
        used as u8,
        flags,
        0,
        0,
        system_id,
        component_id,
        id[0],
        id[1],
        id[2],
    ];
    frame.extend(&payload[..used]);
    append_checksum(&mut frame);
    frame
}

fn append_checksum(frame: &mut Vec<u8>) {
    let message_id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
    let crc = crc16(frame[1..].iter().copied().chain([crc_extra(message_id)]));
    frame.extend(crc.to_le_bytes());
}

/// The same frame as one that says that it is signed; what signs it is missing.
pub fn declare_signed(frame: &[u8]) -> Vec<u8> {
    let mut declared = frame[..frame.len() - CRC_BYTES].to_vec();
    declared[2] |= SIGNED;
    append_checksum(&mut declared);
    declared
}

/// The frame with the checksum of what it says now.
pub fn resealed(frame: &[u8]) -> Vec<u8> {
    let mut sealed = frame[..frame.len() - CRC_BYTES].to_vec();
    append_checksum(&mut sealed);
    sealed
}

/// The same as a MAVLink 1 frame.
pub fn encode_v1(message_id: u32, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xfe, payload.len() as u8, 0, 255, 190, message_id as u8];
    frame.extend(payload);
    let crc = crc16(frame[1..].iter().copied().chain([crc_extra(message_id)]));
    frame.extend(crc.to_le_bytes());
    frame
}

/// CRC-16/MCRF4XX, as the MAVLink serialisation guide defines it.
fn crc16(bytes: impl Iterator<Item = u8>) -> u16 {
    bytes.fold(0xffff, |crc: u16, byte| {
        let mut x = byte ^ (crc & 0xff) as u8;
        x ^= x << 4;
        (crc >> 8) ^ (u16::from(x) << 8) ^ (u16::from(x) << 3) ^ (u16::from(x) >> 4)
    })
}

/// Splits what was sent into frames. A frame that is cut off at the end is left out.
///
/// Panics on anything that is not a frame with a right checksum: a clean wire carries nothing else.
pub fn frames(sent: &[(u64, u8)]) -> Vec<Frame> {
    spans(sent).map(frame).collect()
}

/// The frames as a `.tlog`, which ground stations replay: each after the time of its last byte, in µs.
pub fn tlog(sent: &[(u64, u8)]) -> Vec<u8> {
    let mut log = Vec::new();
    for span in spans(sent) {
        log.extend(span[span.len() - 1].0.to_be_bytes());
        log.extend(span.iter().map(|(_, byte)| byte));
    }
    log
}

/// The bytes of each whole frame.
fn spans(sent: &[(u64, u8)]) -> impl Iterator<Item = &[(u64, u8)]> {
    let mut rest = sent;
    std::iter::from_fn(move || {
        let is_signed = rest.get(2)?.1 == SIGNED;
        let trailer_bytes = if is_signed { TRAILER_BYTES } else { 0 };
        let length = HEADER_BYTES + usize::from(rest[1].1) + CRC_BYTES + trailer_bytes;
        let (span, later) = rest.split_at_checked(length)?;
        rest = later;
        Some(span)
    })
}

fn frame(sent: &[(u64, u8)]) -> Frame {
    let bytes: Vec<u8> = sent.iter().map(|(_, byte)| *byte).collect();
    assert_eq!(bytes[0], START_OF_FRAME, "no frame starts here: {bytes:02x?}");
    assert!(
        bytes[2] <= SIGNED,
        "unexpected incompatibility flags: {bytes:02x?}"
    );
    let unsigned_bytes = HEADER_BYTES + usize::from(bytes[1]) + CRC_BYTES;
    let message_id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
    let (covered, crc) = bytes[..unsigned_bytes].split_at(unsigned_bytes - CRC_BYTES);
    let expected = crc16(covered[1..].iter().copied().chain([crc_extra(message_id)]));
    assert_eq!(crc, expected.to_le_bytes(), "wrong checksum: {bytes:02x?}");
    Frame {
        at_us: sent[sent.len() - 1].0,
        sequence: bytes[4],
        system_id: bytes[5],
        component_id: bytes[6],
        message_id,
        payload: covered[HEADER_BYTES..].to_vec(),
        signed: (bytes[2] == SIGNED).then(|| bytes.clone()),
    }
}

/// Panics if the sequence numbers of `frames` have a gap.
pub fn assert_no_sequence_gap(frames: &[Frame]) {
    for pair in frames.windows(2) {
        assert_eq!(
            pair[1].sequence,
            pair[0].sequence.wrapping_add(1),
            "sequence gap at {} us",
            pair[1].at_us
        );
    }
}

/// What was reported of a pack last.
pub fn last_of(frames: &[Frame], instance: u8) -> BatteryStatus<'_> {
    let frame = of_message(frames, BATTERY_STATUS)
        .into_iter()
        .rfind(|frame| BatteryStatus(frame).instance() == instance);
    BatteryStatus(frame.unwrap_or_else(|| panic!("no BATTERY_STATUS {instance}")))
}

/// The texts, in their order.
pub fn texts_of(frames: &[Frame]) -> Vec<String> {
    let texts = of_message(frames, STATUSTEXT).into_iter();
    texts.map(|frame| frame.text(1, 50)).collect()
}

/// The result of the first command that was answered.
pub fn result_of(frames: &[Frame]) -> u8 {
    of_message(frames, COMMAND_ACK)[0].u8(2)
}

/// The commands that were answered, with their results.
pub fn acknowledged(frames: &[Frame]) -> Vec<(u16, u8)> {
    let acks = of_message(frames, COMMAND_ACK);
    acks.iter().map(|ack| (ack.u16(0), ack.u8(2))).collect()
}

/// The frames of one message.
pub fn of_message(frames: &[Frame], message_id: u32) -> Vec<&Frame> {
    frames.iter().filter(|f| f.message_id == message_id).collect()
}

/// Fields of BATTERY_STATUS, at their places on the wire.
pub struct BatteryStatus<'a>(pub &'a Frame);

impl BatteryStatus<'_> {
    pub fn instance(&self) -> u8 {
        self.0.u8(32)
    }

    pub fn voltage_mv(&self, cell: usize) -> u16 {
        self.0.u16(10 + 2 * cell)
    }

    pub fn sum_of_cells_mv(&self) -> u32 {
        let cells = (0..10).map(|cell| self.voltage_mv(cell));
        cells.filter(|mv| *mv != u16::MAX).map(u32::from).sum()
    }

    pub fn consumed_mah(&self) -> i32 {
        self.0.i32(0)
    }

    pub fn energy_hj(&self) -> i32 {
        self.0.i32(4)
    }

    pub fn temperature_cdegc(&self) -> i16 {
        self.0.i16(8)
    }

    pub fn current_ca(&self) -> i16 {
        self.0.i16(30)
    }

    pub fn battery_type(&self) -> u8 {
        self.0.u8(34)
    }

    pub fn remaining_pct(&self) -> i8 {
        self.0.i8(35)
    }

    pub fn time_remaining_s(&self) -> i32 {
        self.0.i32(36)
    }

    pub fn fault_bitmask(&self) -> u32 {
        self.0.u32(50)
    }

    pub fn charge_state(&self) -> u8 {
        self.0.u8(40)
    }
}

/// Bits of SYS_STATUS: MAV_SYS_STATUS_SENSOR_BATTERY, MAV_SYS_STATUS_PREARM_CHECK.
const BATTERY_SENSOR: u32 = 1 << 25;
const PREARM_CHECK: u32 = 1 << 28;

/// Fields of SYS_STATUS, at their places on the wire.
pub struct SysStatus<'a>(pub &'a Frame);

impl SysStatus<'_> {
    pub fn has_battery_sensor(&self) -> bool {
        self.0.u32(0) & BATTERY_SENSOR != 0
    }

    pub fn is_battery_healthy(&self) -> bool {
        self.0.u32(8) & BATTERY_SENSOR != 0
    }

    /// The arming checks pass.
    pub fn is_ready_to_arm(&self) -> bool {
        self.0.u32(8) & PREARM_CHECK != 0
    }

    pub fn load_permille(&self) -> u16 {
        self.0.u16(12)
    }

    pub fn voltage_mv(&self) -> u16 {
        self.0.u16(14)
    }

    pub fn errors_comm(&self) -> u16 {
        self.0.u16(20)
    }

    /// Messages that were dropped; the other three counts are 0.
    pub fn dropped(&self) -> u16 {
        assert_eq!([self.0.u16(22), self.0.u16(24), self.0.u16(28)], [0; 3]);
        self.0.u16(26)
    }
}

/// The flag of `base_mode`.
pub const ARMED: u8 = 128;

/// Fields of HEARTBEAT, at their places on the wire.
pub struct Heartbeat<'a>(pub &'a Frame);

impl Heartbeat<'_> {
    pub fn custom_mode(&self) -> u32 {
        self.0.u32(0)
    }

    pub fn base_mode(&self) -> u8 {
        self.0.u8(6)
    }

    pub fn system_status(&self) -> u8 {
        self.0.u8(7)
    }
}

/// Fields of PARAM_VALUE, at their places on the wire.
pub struct ParamValue<'a>(pub &'a Frame);

impl ParamValue<'_> {
    pub fn value(&self) -> f32 {
        self.0.f32(0)
    }

    pub fn count(&self) -> u16 {
        self.0.u16(4)
    }

    pub fn index(&self) -> u16 {
        self.0.u16(6)
    }

    pub fn name(&self) -> String {
        self.0.text(8, 16)
    }

    pub fn kind(&self) -> u8 {
        self.0.u8(24)
    }
}
