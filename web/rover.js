// What the rover has said: state, packs, parameters, texts. And requests that it answers.

const MODES = { 0: 'Manual', 4: 'Hold' };
const MANUAL = 0;
const HOLD = 4;

const ARMED_FLAG = 128;
const STATE_TIMED_OUT = 5;
const STATE_TERMINATED = 6;
const ARMING_CHECKS_PASSED = 1 << 28;

const SET_MODE = 176;
const ARM = 400;
const CHECK_ARMING = 401;
const REQUEST_MESSAGE = 512;
const RESTART = 246;

const RESULTS = ['accepted', 'rejected for now', 'denied', 'unsupported', 'failed', 'in progress', 'cancelled'];
const PARAM_ERRORS = { 1: 'there is no such parameter', 2: 'out of range', 3: 'not while armed', 5: 'it is read only' };
const ACCEPTED = 0;

const SEVERITIES = ['Emergency', 'Alert', 'Critical', 'Error', 'Warning', 'Notice', 'Info', 'Debug'];
const MAX_TEXTS = 100;
const MAX_TEXT_CHUNKS = 8;
const CHUNK_CHARACTERS = 50;

const ANSWER_MS = 1000;
const NO_ANSWER = 'no answer';

const UNKNOWN_MV = 65535;

const rover = {
  armed: null,
  mode: null,
  status: 0,
  ready: null,
  load: 0,
  packs: new Map(),
  params: new Map(),
  paramCount: 0,
  texts: [],
  obstacles: [],
  version: null,
};

on('HEARTBEAT', ({ base_mode, custom_mode, system_status }) => {
  const armed = !!(base_mode & ARMED_FLAG);
  if (rover.armed != armed && rover.armed != null) say(armed ? 'Armed' : 'Disarmed');
  Object.assign(rover, { armed, mode: custom_mode, status: system_status });
  emit('state');
});

on('SYS_STATUS', (status) => {
  Object.assign(rover, { load: status.load, errors: status.errors_comm });
  rover.ready = !!(status.onboard_control_sensors_health & ARMING_CHECKS_PASSED);
  if (rover.ready) rover.obstacles = [];
});

on('BATTERY_STATUS', (status) => {
  const pack = packOf(status.id);
  const { voltages, voltages_ext: more } = status;
  const known = [...voltages.filter((mv) => mv != UNKNOWN_MV), ...more.filter((mv) => mv)];
  const isWhole = known.length == 1 || known[0] == UNKNOWN_MV - 1;
  const scaled = (value, unknown, by) => (value == unknown ? null : value / by);
  Object.assign(pack, {
    at: performance.now(),
    state: status.charge_state,
    faults: status.fault_bitmask,
    volts: known.length ? known.reduce((sum, mv) => sum + mv, 0) / 1000 : null,
    cells: isWhole ? [] : known.map((mv) => mv / 1000),
    amps: scaled(status.current_battery, -1, 100),
    percent: scaled(status.battery_remaining, -1, 1),
    drawn: scaled(status.current_consumed, -1, 1),
    left: scaled(status.time_remaining, 0, 1),
    celsius: scaled(status.temperature, 32767, 100),
  });
  emit('pack', pack);
});

on('BATTERY_INFO', (info) => {
  Object.assign(packOf(info.id), { cellCount: info.cells_in_series, health: info.state_of_health });
});

function packOf(id) {
  if (!rover.packs.has(id)) {
    rover.packs.set(id, { id, name: 'Battery ' + (id + 1), prefix: 'BATT' + (id ? id + 1 : '') + '_', history: [] });
    command(REQUEST_MESSAGE, MESSAGES.BATTERY_INFO.id, id);
  }
  return rover.packs.get(id);
}

// A text of more than one message ends with a chunk that is not full.
const chunks = [];
on('STATUSTEXT', ({ severity, text, id, chunk_seq }) => {
  if (!chunk_seq) chunks.length = 0;
  chunks.push(text);
  if (id && text.length == CHUNK_CHARACTERS && chunks.length < MAX_TEXT_CHUNKS) return;
  const whole = chunks.splice(0).join('');
  const obstacle = /^PreArm: (.*)/.exec(whole);
  if (obstacle) {
    if (!rover.obstacles.includes(obstacle[1])) rover.obstacles.push(obstacle[1]);
    return;
  }
  const entry = { at: new Date(), severity, text: whole };
  rover.texts.unshift(entry);
  rover.texts.splice(MAX_TEXTS);
  const pack = /^Battery (\d)/.exec(whole);
  if (pack && rover.packs.has(pack[1] - 1)) rover.packs.get(pack[1] - 1).text = entry;
  if (severity < 5) say(whole);
  emit('text', entry);
});

on('AUTOPILOT_VERSION', (version) => (rover.version = version));

const after = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// Sends a command until it is acknowledged; the result, or null without an answer.
async function command(number, param1 = 0, param2 = 0, tries = 3) {
  for (let confirmation = 0; confirmation < tries; confirmation++) {
    const answer = next('COMMAND_ACK', (ack) => ack.command == number);
    link.ask('COMMAND_LONG', { command: number, param1, param2, confirmation });
    const ack = await answer;
    if (ack) return ack.result;
  }
  return null;
}

// The next message of this name that fits; null if none comes in time.
function next(name, fits, ms = ANSWER_MS) {
  return new Promise((resolve) => {
    const list = (handlers[name] ||= []);
    const end = (value) => {
      clearTimeout(timer);
      list.splice(list.indexOf(take), 1);
      resolve(value);
    };
    const take = (value) => fits(value) && end(value);
    const timer = setTimeout(() => end(null), ms);
    list.push(take);
  });
}

const because = (result) => (result == null ? NO_ANSWER : RESULTS[result] || 'refused');

// The heartbeat that follows a command of the rover's state comes at once.
async function commandState(number, param1, param2, tries) {
  const result = await command(number, param1, param2, tries);
  command(REQUEST_MESSAGE, MESSAGES.HEARTBEAT.id);
  return result;
}

const setMode = (mode) => commandState(SET_MODE, 1, mode);

const value = (name) => rover.params.get(name)?.value;

on('PARAM_VALUE', ({ param_id, param_value, param_type, param_index, param_count }) => {
  rover.params.set(param_id, { name: param_id, value: param_value, type: param_type, index: param_index });
  rover.paramCount = param_count;
  emit('param', param_id);
});

// Sets a parameter; why it was refused, or nothing. The valid range comes as a text of its own.
async function setParameter(name, wanted) {
  const [before] = rover.texts;
  let error = '';
  const refused = next('PARAM_ERROR', (answer) => answer.param_id == name && (error = PARAM_ERRORS[answer.error] || 'refused'));
  for (let tries = 0; tries < 3; tries++) {
    const answer = next('PARAM_VALUE', (answer) => answer.param_id == name);
    const known = rover.params.get(name);
    link.ask('PARAM_SET', { param_id: name, param_value: wanted, param_type: known ? known.type : 9 });
    const got = await Promise.race([answer, refused.then((answer) => answer && {})]);
    if (error) {
      await after(300);
      const texts = rover.texts.slice(0, before ? rover.texts.indexOf(before) : MAX_TEXTS);
      const why = texts.find(({ text }) => text.includes(name) || /armed/.test(text));
      return why ? why.text : error;
    }
    if (got) return '';
  }
  return NO_ANSWER;
}

// Reads the list, then by index what was missed.
let listing = 0;
async function readParameters() {
  const run = ++listing;
  rover.params.clear();
  rover.paramCount = 0;
  link.ask('PARAM_REQUEST_LIST');
  while (run == listing && link.isOpen) {
    if (await next('PARAM_VALUE', () => true, 1500)) continue;
    const read = new Set([...rover.params.values()].map((param) => param.index));
    const missing = Array.from({ length: rover.paramCount }, (_, index) => index).filter((index) => !read.has(index));
    if (rover.paramCount && !missing.length) break;
    if (!rover.paramCount) link.ask('PARAM_REQUEST_LIST');
    for (const index of missing.slice(0, 10)) link.ask('PARAM_REQUEST_READ', { param_index: index });
  }
  emit('params');
}

on('opened', async () => {
  rover.version = null;
  if (!(await next('HEARTBEAT', () => true, FRESH_MS))) return;
  command(REQUEST_MESSAGE, MESSAGES.AUTOPILOT_VERSION.id);
  for (const id of rover.packs.keys()) command(REQUEST_MESSAGE, MESSAGES.BATTERY_INFO.id, id);
  readParameters();
});

// Why the rover does not arm is asked for while it would not.
async function askObstacles() {
  if (rover.ready != false || rover.armed || !link.isFresh || document.hidden) return;
  rover.obstacles = [];
  await command(CHECK_ARMING, 0, 0, 1);
}
setInterval(askObstacles, 5000);
on('SYS_STATUS', () => rover.ready == false && !rover.obstacles.length && !rover.asked && (rover.asked = true, askObstacles()));
