// The WebSocket to the rover: opened again whenever it is lost, signed if there is a key.

const COMPONENT = 190;
const SECOND = 1000;

// A heartbeat older than this may be the last one. A socket that has been silent for longer is opened again: one whose
// network has vanished says nothing for minutes.
const FRESH_MS = 2500;
const DEAD_MS = 5000;

const now = () => performance.now();

const handlers = {};
const on = (name, handler) => (handlers[name] ||= []).push(handler);
const off = (name, handler) => (handlers[name] = handlers[name].filter((other) => other != handler));
const emit = (name, value) => handlers[name]?.forEach((handler) => handler(value));

let socket;
let signer = null;
// Each page is a ground station of its own.
const ownSystem = 60 + random(190);
let roverSystem = 1;
let sequence = 0;
let lastSequence = null;
let received = 0;
let lost = 0;
let ignored = 0;
let roverSigns = 0;
let openedAt = 0;
let heardAt = 0;
let heartbeatAt = -Infinity;
let beatAt;
// The latest ping that was answered: when it was sent, and how long the answer took.
let answeredAt = 0;
let roundTrip;

const isOpen = () => socket?.readyState == 1;

// How long ago the rover was heard, in ms.
const age = () => now() - heartbeatAt;
const isFresh = () => isOpen() && age() < FRESH_MS;

// How long answers take, in ms, or the next one has taken so far.
const delay = () => Math.max(roundTrip, now() - Math.max(openedAt, answeredAt) - SECOND);

function connect() {
  const parse = parser(receive);
  let wasOpen = 0;
  if (socket) {
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
  }
  const opened = (socket = new WebSocket('ws://' + location.host + '/'));
  openedAt = now();
  lastSequence = null;
  roundTrip = 0;
  beatAt = -SECOND;
  opened.binaryType = 'arraybuffer';
  opened.onopen = () => {
    wasOpen = 1;
    heardAt = now();
    emit('opened');
    beat();
  };
  opened.onmessage = ({ data }) => parse(new Uint8Array(data));
  opened.onclose = () => {
    emit('closed', wasOpen);
    setTimeout(() => socket == opened && connect(), SECOND);
  };
}

function send(name, values) {
  if (isOpen()) socket.send(encode(name, values, ownSystem, COMPONENT, sequence++ & 255, signer?.sign));
}

// To the rover. It refuses what was under way for too long, by the time that is stated before; 0 would be none. The date is for
// its logs.
function ask(name, values) {
  send('SYSTEM_TIME', { time_unix_usec: BigInt(Date.now()) * 1000n, time_boot_ms: now() + 1 });
  send(name, { target_system: roverSystem, ...values });
}

const ping = () => ask('PING', { seq: now() });

on('PING', ({ seq }) => {
  answeredAt = seq;
  roundTrip = now() - seq;
});

function beat() {
  if (now() - beatAt < SECOND) return;
  beatAt = now();
  send('HEARTBEAT', { type: 6, autopilot: 8, system_status: 4, mavlink_version: 3 });
  ping();
}

function receive(frame) {
  const { name, fields, isSigned, system } = frame;
  received++;
  heardAt = now();
  if (lastSequence != null) lost += (frame.sequence - lastSequence - 1) & 255;
  lastSequence = frame.sequence;
  roverSigns = isSigned;
  if (signer && !signer.accepts(frame)) {
    ignored++;
    return;
  }
  if (name == 'HEARTBEAT') {
    roverSystem = system;
    heartbeatAt = now();
    // Timers of a hidden page are slow, what arrives is not.
    beat();
  }
  emit(name, fields);
  emit('any', fields);
}

// Nowhere but in this variable: what a browser stores for the rover's address, any page of the same address can read.
function useKey(key) {
  signer = key && newSigner(key);
  ignored = 0;
}

function keepLink() {
  beat();
  if (now() - Math.max(openedAt, heardAt) < DEAD_MS) return;
  emit('closed', isOpen());
  connect();
}

