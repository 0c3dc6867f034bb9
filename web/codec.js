// MAVLink 2: frames from messages, and messages from a stream of bytes.

const START = 0xfd;
const HEADER_BYTES = 10;
const SIGNATURE_BYTES = 13;
const SIGNED = 1;

const TYPES = {
  B: ['Uint8', 1], b: ['Int8', 1], H: ['Uint16', 2], h: ['Int16', 2],
  I: ['Uint32', 4], i: ['Int32', 4], f: ['Float32', 4], Q: ['BigUint64', 8],
};

const MESSAGES = {};
for (const row of MESSAGE_TABLE.trim().split('\n')) {
  const [name, id, extra, size, ...fields] = row.split(' ');
  MESSAGES[name] = MESSAGES[id] = {
    name, id: +id, extra: +extra, size: +size,
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

function read(view, { type, at, count }) {
  if (type == 's') {
    let text = '';
    for (let place = at; place < at + count && view.getUint8(place); place++) {
      text += String.fromCharCode(view.getUint8(place));
    }
    return text;
  }
  const [kind, size] = TYPES[type];
  const one = (index) => view['get' + kind](at + index * size, true);
  return count ? Array.from({ length: count }, (_, index) => one(index)) : one(0);
}

function write(view, { type, at, count }, value) {
  if (type == 's') {
    for (let place = 0; place < Math.min(count, value.length); place++) {
      view.setUint8(at + place, value.charCodeAt(place));
    }
  } else {
    view['set' + TYPES[type][0]](at, value, true);
  }
}

// A frame; fields that aren't given are 0. With `sign` it is signed: that gets all bytes before the signature.
function encode(name, values, { system, component, sequence, sign }) {
  const message = MESSAGES[name];
  const payload = new Uint8Array(message.size);
  const view = new DataView(payload.buffer);
  for (const field of message.fields) {
    if (field.key in values) write(view, field, values[field.key]);
  }
  let length = payload.length;
  while (length > 1 && !payload[length - 1]) length--;
  const id = message.id;
  const head = [length, sign ? SIGNED : 0, 0, sequence, system, component, id & 255, (id >> 8) & 255, id >> 16];
  const body = [...head, ...payload.subarray(0, length)];
  const crc = crcOf([...body, message.extra]);
  const frame = [START, ...body, crc & 255, crc >> 8];
  return Uint8Array.from(sign ? sign(frame) : frame);
}

// Finds frames in pieces of a stream, whatever they begin and end with. What is no frame is skipped byte by byte; of
// messages that the page doesn't know the checksum can't be tested.
class Parser {
  constructor(onFrame) {
    this.onFrame = onFrame;
    this.rest = new Uint8Array();
  }

  push(piece) {
    const bytes = new Uint8Array(this.rest.length + piece.length);
    bytes.set(this.rest);
    bytes.set(piece, this.rest.length);
    let at = 0;
    while (bytes.length - at >= HEADER_BYTES + 2) {
      const length = bytes[at] == START ? this.lengthOf(bytes, at) : 0;
      if (at + length > bytes.length) break;
      const frame = length && this.decode(bytes.slice(at, at + length));
      at += frame ? length : 1;
      if (frame) this.onFrame(frame);
    }
    this.rest = bytes.slice(at);
  }

  lengthOf(bytes, at) {
    const signature = bytes[at + 2] & SIGNED ? SIGNATURE_BYTES : 0;
    return HEADER_BYTES + bytes[at + 1] + 2 + signature;
  }

  decode(bytes) {
    const end = HEADER_BYTES + bytes[1];
    const id = bytes[7] | (bytes[8] << 8) | (bytes[9] << 16);
    const message = MESSAGES[id];
    const fields = {};
    if (message) {
      const crc = crcOf([...bytes.subarray(1, end), message.extra]);
      if (crc != (bytes[end] | (bytes[end + 1] << 8))) return null;
      const payload = new Uint8Array(Math.max(message.size, bytes[1]));
      payload.set(bytes.subarray(HEADER_BYTES, end));
      const view = new DataView(payload.buffer);
      for (const field of message.fields) fields[field.key] = read(view, field);
    }
    return {
      name: message ? message.name : '', fields, bytes, isSigned: bytes[2] & SIGNED,
      sequence: bytes[4], system: bytes[5], component: bytes[6],
    };
  }
}
