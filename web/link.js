// The WebSocket to the rover: opened again whenever it is lost, signed if there is a key.

const COMPONENT = 190;
const HEARTBEAT_MS = 1000;
const RETRY_MS = 1000;

// A heartbeat older than this may be the last one. A socket that has been silent for longer is opened again: one whose
// network has vanished says nothing for minutes.
const FRESH_MS = 2500;
const DEAD_MS = 5000;

const KEY_STORE = 'signing-key';

const handlers = {};
const on = (name, handler) => (handlers[name] ||= []).push(handler);
const emit = (name, value) => [...(handlers[name] || [])].forEach((handler) => handler(value));

const link = {
  socket: null,
  signer: null,
  // Each page is a ground station of its own.
  system: 60 + Math.floor(Math.random() * 190),
  rover: { system: 1, component: 1 },
  sequence: 0,
  received: 0,
  lost: 0,
  ignored: 0,
  roverSigns: false,
  reached: false,
  heartbeatAt: -Infinity,
  heardAt: 0,
  openedAt: 0,
  sentAt: 0,

  get isOpen() {
    return !!this.socket && this.socket.readyState == 1;
  },

  // How long ago the rover was heard, in ms.
  get age() {
    return performance.now() - this.heartbeatAt;
  },

  get isFresh() {
    return this.isOpen && this.age < FRESH_MS;
  },

  // Whether what was sent has left.
  get isDrained() {
    return this.isOpen && !this.socket.bufferedAmount;
  },

  open() {
    const socket = new WebSocket('ws://' + location.host + '/');
    const parser = new Parser((frame) => this.receive(frame));
    let wasOpen = false;
    this.close();
    this.socket = socket;
    this.openedAt = performance.now();
    this.last = null;
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      wasOpen = true;
      this.heardAt = performance.now();
      this.beat();
      emit('opened');
    };
    socket.onmessage = ({ data }) => parser.push(new Uint8Array(data));
    socket.onclose = () => {
      emit('closed', wasOpen);
      setTimeout(() => this.socket == socket && this.open(), RETRY_MS);
    };
  },

  close() {
    if (!this.socket) return;
    this.socket.onopen = this.socket.onmessage = this.socket.onclose = null;
    this.socket.close();
  },

  send(name, values) {
    if (!this.isOpen) return false;
    const { signer, system } = this;
    const sign = signer && ((frame) => signer.sign(frame));
    const sequence = this.sequence++ & 255;
    this.socket.send(encode(name, values, { system, component: COMPONENT, sequence, sign }));
    return true;
  },

  // To the rover.
  ask(name, values = {}) {
    const { system, component } = this.rover;
    return this.send(name, { target_system: system, target_component: component, ...values });
  },

  beat() {
    const now = performance.now();
    if (this.isOpen && now - this.sentAt >= HEARTBEAT_MS - 100) {
      this.sentAt = now;
      this.send('HEARTBEAT', { type: 6, autopilot: 8, system_status: 4, mavlink_version: 3 });
    }
  },

  receive(frame) {
    this.received++;
    this.heardAt = performance.now();
    if (this.last != null) this.lost += (frame.sequence - this.last - 1) & 255;
    this.last = frame.sequence;
    this.roverSigns = !!frame.isSigned;
    if (this.signer && !this.signer.accepts(frame)) {
      this.ignored++;
      return;
    }
    if (frame.name == 'HEARTBEAT') {
      this.rover = { system: frame.system, component: frame.component };
      this.heartbeatAt = performance.now();
      // Timers of a hidden page are slow, what arrives is not.
      this.beat();
    }
    emit(frame.name, frame.fields);
  },

  // Opens again what is silent.
  watch() {
    this.beat();
    if (performance.now() - Math.max(this.openedAt, this.heardAt) > DEAD_MS) {
      emit('closed', this.isOpen);
      this.open();
    }
  },

  use(key) {
    this.signer = key ? new Signer(key) : null;
    this.ignored = 0;
    if (key) sessionStorage[KEY_STORE] = [...key];
    else sessionStorage.removeItem(KEY_STORE);
    emit('key');
  },

  start() {
    const stored = sessionStorage[KEY_STORE];
    if (stored) this.use(Uint8Array.from(stored.split(',')));
    this.open();
    setInterval(() => this.watch(), HEARTBEAT_MS);
  },
};
