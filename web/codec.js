// MAVLink 2: frames from messages, and messages from a stream of bytes.

const START = 0xfd;
const HEADER_BYTES = 10;
const SIGNATURE_BYTES = 13;
const MAX_PAYLOAD_BYTES = 255;
const SIGNED = 1;

// A frame has the byte order of every browser.
const TYPES = {
  B: Uint8Array, b: Int8Array, H: Uint16Array, h: Int16Array, I: Uint32Array, i: Int32Array,
  f: Float32Array, Q: BigUint64Array, s: Uint8Array,
};

const MESSAGES = {};
for (const row of MESSAGE_TABLE.trim().split('\n')) {
  const [name, id, extra, ...fields] = row.split(' ');
  MESSAGES[name] = MESSAGES[id] = {
    name, id: +id, extra: +extra,
    fields: fields.map((field) => {
      const [, key, type, at, count] = /(\w+):(\w)(\d+)x?(\d*)/.exec(field);
      return { key, type, at: +at, count: +count };
    }),
  };
}

function crcOf(bytes, crc = 0xffff) {
  for (const byte of bytes) {
    let low = byte ^ (crc & 0xff);
    low = (low ^ (low << 4)) & 0xff;
    crc = (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4);
  }
  return crc;
}

function read(payload, { type, at, count }) {
  const all = [...new TYPES[type](payload.slice(at).buffer, 0, count || 1)];
  if (type == 's') return String.fromCharCode(...all).split('\0')[0];
  return count ? all : all[0];
}

function bytesOf(type, value) {
  return type == 's' ? new TextEncoder().encode(value) : new Uint8Array(new TYPES[type]([value].flat()).buffer);
}

// A frame; fields that aren't given are 0, and zeros at the end are left out. With `sign`, which gets all that stands before
// the signature, it is signed.
function encode(name, values, system, component, sequence, sign) {
  const message = MESSAGES[name];
  const payload = new Uint8Array(MAX_PAYLOAD_BYTES);
  for (const { key, type, at } of message.fields) {
    if (key in values) payload.set(bytesOf(type, values[key]), at);
  }
  let length = MAX_PAYLOAD_BYTES;
  while (length > 1 && !payload[length - 1]) length--;
  const id = message.id;
  const head = [length, sign ? SIGNED : 0, 0, sequence, system, component, id & 255, (id >> 8) & 255, id >> 16];
  const body = [...head, ...payload.subarray(0, length)];
  const crc = crcOf([...body, message.extra]);
  const frame = [START, ...body, crc & 255, crc >> 8];
  return Uint8Array.from(sign ? sign(frame) : frame);
}

function decode(bytes) {
  const end = HEADER_BYTES + bytes[1];
  const message = MESSAGES[bytes[7] | (bytes[8] << 8) | (bytes[9] << 16)];
  const fields = {};
  if (message) {
    const crc = crcOf([...bytes.subarray(1, end), message.extra]);
    if (crc != (bytes[end] | (bytes[end + 1] << 8))) return 0;
    const payload = new Uint8Array(MAX_PAYLOAD_BYTES);
    payload.set(bytes.subarray(HEADER_BYTES, end));
    for (const field of message.fields) fields[field.key] = read(payload, field);
  }
  return {
    name: message?.name, fields, bytes, isSigned: bytes[2] & SIGNED,
    sequence: bytes[4], system: bytes[5], component: bytes[6],
  };
}

// Takes pieces of a stream, whatever they begin and end with, and gives the frames in it. What is no frame is skipped byte
// by byte; of messages that the page doesn't know the checksum can't be tested.
function parser(onFrame) {
  let rest = [];
  return (piece) => {
    const bytes = Uint8Array.from([...rest, ...piece]);
    let at = 0;
    while (bytes.length - at >= HEADER_BYTES + 2) {
      const isStart = bytes[at] == START && bytes[at + 2] <= SIGNED;
      const length = HEADER_BYTES + bytes[at + 1] + 2 + (bytes[at + 2] & SIGNED) * SIGNATURE_BYTES;
      if (isStart && at + length > bytes.length) break;
      const frame = isStart && decode(bytes.slice(at, at + length));
      at += frame ? length : 1;
      if (frame) onFrame(frame);
    }
    rest = bytes.slice(at);
  };
}
