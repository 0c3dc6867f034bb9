//! A MAVLink 2 reader for tests, written from the protocol's description and not from the crate the firmware uses, so
//! that both can't make the same mistake.

/// A line for each message that the tests use, `NAME = number, extra byte of the checksum;`, as the message definitions have it:
/// makes the constant `NAME` of the number, and `crc_extra`, which looks the extra byte up by the number.
macro_rules! messages {
    ($($name:ident = $id:literal, $crc_extra:literal;)*) => {
        $(pub const $name: u32 = $id;)*

        fn crc_extra(message_id: u32) -> u8 {
            match message_id {
                $($name => $crc_extra,)*
                other => panic!("message {other} is not one of the tests'"),
            }
        }
    };
}

messages! {
    HEARTBEAT = 0, 50;
    SYS_STATUS = 1, 124;
    SYSTEM_TIME = 2, 137;
    PING = 4, 237;
    SET_MODE = 11, 89;
    PARAM_REQUEST_READ = 20, 214;
    PARAM_REQUEST_LIST = 21, 159;
    PARAM_VALUE = 22, 220;
    PARAM_SET = 23, 168;
    MISSION_COUNT = 44, 221;
    MISSION_ACK = 47, 153;
    REQUEST_DATA_STREAM = 66, 148;
    MANUAL_CONTROL = 69, 243;
    RC_CHANNELS_OVERRIDE = 70, 124;
    COMMAND_INT = 75, 158;
    COMMAND_LONG = 76, 152;
    COMMAND_ACK = 77, 143;
    RADIO_STATUS = 109, 185;
    FILE_TRANSFER_PROTOCOL = 110, 84;
    TIMESYNC = 111, 34;
    LOG_REQUEST_LIST = 117, 128;
    LOG_ENTRY = 118, 56;
    LOG_REQUEST_DATA = 119, 116;
    LOG_DATA = 120, 134;
    LOG_ERASE = 121, 237;
    LOG_REQUEST_END = 122, 203;
    BATTERY_STATUS = 147, 154;
    AUTOPILOT_VERSION = 148, 178;
    MESSAGE_INTERVAL = 244, 95;
    NAMED_VALUE_FLOAT = 251, 170;
    STATUSTEXT = 253, 83;
    SETUP_SIGNING = 256, 71;
    WIFI_CONFIG_AP = 299, 19;
    PROTOCOL_VERSION = 300, 217;
    PARAM_ERROR = 345, 209;
    BATTERY_STATUS_V2 = 369, 145;
    SMART_BATTERY_INFO = 370, 75;
    FUEL_STATUS = 371, 10;
    BATTERY_INFO = 372, 26;
    COMPONENT_METADATA = 397, 182;
    AVAILABLE_MODES = 435, 134;
}

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

/// A method of each type's name, such as `frame.u16(12)`: reads a number of this type from this place of the payload on.
macro_rules! numbers {
    ($($number:ident)*) => {
        $(pub fn $number(&self, offset: usize) -> $number {
            $number::from_le_bytes(self.bytes(offset))
        })*
    };
}

impl Frame {
    pub fn payload_len(&self) -> usize {
        self.payload.len()
    }

    fn bytes<const N: usize>(&self, offset: usize) -> [u8; N] {
        core::array::from_fn(|i| self.payload.get(offset + i).copied().unwrap_or(0))
    }

    numbers!(u8 i8 u16 i16 u32 i32 f32);

    /// Characters up to the first zero, `length` at most.
    pub fn text(&self, offset: usize, length: usize) -> String {
        (offset..offset + length)
            .map(|at| self.u8(at))
            .take_while(|byte| *byte != 0)
            .map(char::from)
            .collect()
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
    let mut frame = vec![START_OF_FRAME, used as u8, flags, 0, 0, system_id, component_id];
    frame.extend(&message_id.to_le_bytes()[..3]);
    frame.extend(&payload[..used]);
    append_checksum(&mut frame);
    frame
}

fn message_id(frame: &[u8]) -> u32 {
    u32::from_le_bytes([frame[7], frame[8], frame[9], 0])
}

/// The checksum of a frame of this message, in which everything before the checksum is there.
fn checksum(frame: &[u8], message_id: u32) -> [u8; CRC_BYTES] {
    crc16(frame[1..].iter().copied().chain([crc_extra(message_id)])).to_le_bytes()
}

fn append_checksum(frame: &mut Vec<u8>) {
    frame.extend(checksum(frame, message_id(frame)));
}

/// This frame as one that says that it is signed; what signs it is missing.
pub fn declare_signed(frame: &[u8]) -> Vec<u8> {
    let mut declared = frame.to_vec();
    declared[2] |= SIGNED;
    resealed(&declared)
}

/// The frame with the checksum of what it says now.
pub fn resealed(frame: &[u8]) -> Vec<u8> {
    let mut sealed = frame[..frame.len() - CRC_BYTES].to_vec();
    append_checksum(&mut sealed);
    sealed
}

/// A message as a MAVLink 1 frame.
pub fn encode_v1(message_id: u32, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xfe, payload.len() as u8, 0, 255, 190, message_id as u8];
    frame.extend(payload);
    frame.extend(checksum(&frame, message_id));
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
    let message_id = message_id(&bytes);
    let (covered, crc) = bytes[..unsigned_bytes].split_at(unsigned_bytes - CRC_BYTES);
    assert_eq!(crc, checksum(covered, message_id), "wrong checksum: {bytes:02x?}");
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

/// All reports of a pack.
pub fn statuses_of(frames: &[Frame], instance: u8) -> Vec<BatteryStatus<'_>> {
    let statuses = of_message(frames, BATTERY_STATUS).into_iter().map(BatteryStatus);
    statuses.filter(|status| status.instance() == instance).collect()
}

/// The last report of a pack.
pub fn last_of(frames: &[Frame], instance: u8) -> BatteryStatus<'_> {
    let last = statuses_of(frames, instance).pop();
    last.unwrap_or_else(|| panic!("no BATTERY_STATUS {instance}"))
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

/// A type around a frame of a message, with a method for each line `field, type at place;`: the field's value, of this type,
/// from this place of the payload on. For example, `fields! { SysStatus: voltage_mv, u16 at 14; }` makes the type
/// `SysStatus`, of which `SysStatus(&frame).voltage_mv()` is the `u16` at 14.
macro_rules! fields {
    ($message:ident: $($field:ident, $number:ident at $place:literal;)*) => {
        /// Fields of a message, at their places on the wire.
        pub struct $message<'a>(pub &'a Frame);

        impl $message<'_> {
            $(pub fn $field(&self) -> $number {
                self.0.$number($place)
            })*
        }
    };
}

fields! { BatteryStatus:
    consumed_mah, i32 at 0;
    energy_hj, i32 at 4;
    temperature_cdegc, i16 at 8;
    current_ca, i16 at 30;
    instance, u8 at 32;
    battery_type, u8 at 34;
    remaining_pct, i8 at 35;
    time_remaining_s, i32 at 36;
    charge_state, u8 at 40;
    fault_bitmask, u32 at 50;
}

impl BatteryStatus<'_> {
    pub fn voltage_mv(&self, cell: usize) -> u16 {
        self.0.u16(10 + 2 * cell)
    }

    pub fn sum_of_cells_mv(&self) -> u32 {
        let cells = (0..10).map(|cell| self.voltage_mv(cell));
        cells.filter(|mv| *mv != u16::MAX).map(u32::from).sum()
    }
}

/// Bits of SYS_STATUS: MAV_SYS_STATUS_SENSOR_BATTERY, MAV_SYS_STATUS_PREARM_CHECK.
const BATTERY_SENSOR: u32 = 1 << 25;
const PREARM_CHECK: u32 = 1 << 28;

fields! { SysStatus:
    load_permille, u16 at 12;
    voltage_mv, u16 at 14;
    errors_comm, u16 at 20;
}

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

    /// Messages that were dropped; the other three counts are 0.
    pub fn dropped(&self) -> u16 {
        assert_eq!([self.0.u16(22), self.0.u16(24), self.0.u16(28)], [0; 3]);
        self.0.u16(26)
    }
}

/// The flag of `base_mode`.
pub const ARMED: u8 = 128;

fields! { Heartbeat:
    custom_mode, u32 at 0;
    base_mode, u8 at 6;
    system_status, u8 at 7;
}

fields! { ParamValue:
    value, f32 at 0;
    count, u16 at 4;
    index, u16 at 6;
    kind, u8 at 24;
}

impl ParamValue<'_> {
    pub fn name(&self) -> String {
        self.0.text(8, 16)
    }
}
