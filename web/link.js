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
const ownSystem = 60 + Math.floor(Math.random() * 190);
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
let beatAt = 0;

const isOpen = () => socket?.readyState == 1;

// How long ago the rover was heard, in ms.
const age = () => now() - heartbeatAt;
const isFresh = () => isOpen() && age() < FRESH_MS;

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
  opened.binaryType = 'arraybuffer';
  opened.onopen = () => {
    wasOpen = 1;
    heardAt = now();
    beat();
    emit('opened');
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

// To the rover.
const ask = (name, values) => send(name, { target_system: roverSystem, ...values });

function beat() {
  if (now() - beatAt < SECOND - 100) return;
  beatAt = now();
  send('HEARTBEAT', { type: 6, autopilot: 8, system_status: 4, mavlink_version: 3 });
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
}

function useKey(key) {
  signer = key && newSigner(key);
  ignored = 0;
  sessionStorage.signingKey = key || '';
}

function startLink() {
  const stored = sessionStorage.signingKey;
  if (stored) useKey(stored.split(','));
  connect();
  setInterval(() => {
    beat();
    if (now() - Math.max(openedAt, heardAt) < DEAD_MS) return;
    emit('closed', isOpen());
    connect();
  }, SECOND);
}
