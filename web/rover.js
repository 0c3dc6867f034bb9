// What the rover has said: state, packs, parameters, texts. And requests that it answers.

const MODES = { 0: 'Manual', 4: 'Hold' };
const MANUAL = 0;
const HOLD = 4;

const ARMED_FLAG = 128;
const STATE_TIMED_OUT = 5;
const STATE_TERMINATED = 6;
const ARMING_CHECKS_PASSED = 1 << 28;

// A failsafe's action.
const TERMINATE = 5;

const SET_MODE = 176;
const RESTART = 246;
const ARM = 400;
const CHECK_ARMING = 401;
const SET_INTERVAL = 511;
const REQUEST_MESSAGE = 512;

const REFUSED = 'refused';
const NO_ANSWER = 'no answer';
const NO_KEY = 'Without the key nothing is obeyed.';
const REAL32 = 9;

const MAX_TEXTS = 100;
// The greeting to a new station may come more than once by one connection.
const GREETING_MS = 5000;
// Interval of NAMED_VALUE_FLOAT.
const ESTIMATES_US = 2000000;

// Kinds of pack that have a voltage only.
const VOLTAGE_ONLY = [3, 6];
// Kinds that measure fuel: its flow is in the current's field.
const TANKS = [11, 12, 18, 24, 27];
const CHUNK_CHARACTERS = 50;
// A cell that is not there, or an index that is not known.
const UNKNOWN = 65535;

// Unknown until the first heartbeat.
let armed = null;
let mode;
let status;
// Unknown until the first SYS_STATUS.
let ready = null;
let system = {};
let version;
// Whether it is known which rover this connection leads to: all of them have the same address.
let isIdentified;
let paramCount = 0;
// Why it does not arm.
let obstacles = [];
// The latest first.
const texts = [];
const packs = new Map();
const params = new Map();

const allPacks = () => [...packs.values()].filter((pack) => pack.at);
// The one that is plotted and set up.
const chosenPack = () => packs.get(+$('pack').value) || {};
const textLike = (pattern) => texts.find(({ text }) => pattern.test(text))?.text;
const value = (name) => params.get(name)?.param_value;
const kindOf = ({ prefix }) => value(prefix + 'MONITOR');
const isVoltageOnly = (pack) => VOLTAGE_ONLY.includes(kindOf(pack));
const isTank = (pack) => TANKS.includes(kindOf(pack));
const parameterOf = (name) => (chosenPack().prefix || 'BATT_') + name;

const isKnown = () => isFresh() && isIdentified;
const UNSIGNED_ALLOWED = 2;
const allowed = () => value('SIGN_WIFI_ALLOW');
// While it is unknown what the rover allows without the key, a PING that is never answered shows it.
const PINGS_MS = 3000;
const isPingIgnored = () => answeredAt < openedAt && now() - openedAt > PINGS_MS;
const isUnsigned = () => roverSigns && !signer;
const lacksKey = () => isUnsigned() && (allowed() == null ? isPingIgnored() : allowed() != UNSIGNED_ALLOWED);

on('HEARTBEAT', ({ base_mode, custom_mode, system_status }) => {
  const isArmed = !!(base_mode & ARMED_FLAG);
  if (armed != isArmed && armed != null) say(isArmed ? 'Armed' : 'Disarmed');
  armed = isArmed;
  mode = custom_mode;
  status = system_status;
  if (!isIdentified) request('AUTOPILOT_VERSION');
  emit('state');
});

on('SYS_STATUS', (fields) => {
  const was = ready;
  system = fields;
  ready = !!(fields.onboard_control_sensors_health & ARMING_CHECKS_PASSED);
  if (ready) obstacles = [];
  else if (was != ready) askObstacles();
});

on('BATTERY_STATUS', (fields) => {
  const pack = packOf(fields.id);
  const known = [...fields.voltages.filter((mv) => mv != UNKNOWN), ...fields.voltages_ext.filter((mv) => mv)];
  // A voltage that one field has no room for goes on in the next.
  const isWhole = known.length == 1 || known[0] == UNKNOWN - 1;
  const unless = (unknown, number, by = 1) => (number == unknown ? null : number / by);
  const volts = known.length ? known.reduce((sum, mv) => sum + mv) / 1000 : null;
  const amps = unless(-1, fields.current_battery, 100);
  Object.assign(pack, {
    at: now(),
    state: fields.charge_state,
    cells: isWhole ? [] : known.map((mv) => mv / 1000),
    percent: unless(-1, fields.battery_remaining),
    volts,
    amps,
    watts: volts == null || amps == null ? null : volts * amps,
    drawn: unless(-1, fields.current_consumed),
    left: unless(0, fields.time_remaining),
    celsius: unless(32767, fields.temperature, 100),
  });
  emit('pack', pack);
});

on('BATTERY_INFO', ({ id, type, cells_in_series, design_capacity, full_charge_capacity, state_of_health }) =>
  Object.assign(packOf(id), {
    chemistry: type, cellCount: cells_in_series, design: design_capacity * 1000, full: full_charge_capacity * 1000,
    health: state_of_health > 100 ? null : state_of_health,
  }));

// The standard deviation of the charge, and what of it is usable, in percent.
on('NAMED_VALUE_FLOAT', ({ name, value }) => {
  const [, number, key] = /^BAT(\d)_(SIGMA|USABL)/.exec(name) || [];
  if (number) packOf(number - 1)[key] = Number.isNaN(value) ? null : value;
});

function packOf(id) {
  if (!packs.has(id)) {
    packs.set(id, { id, name: 'Battery ' + (id + 1), prefix: 'BATT' + (id ? id + 1 : '') + '_', history: [], causes: {} });
    request('BATTERY_INFO', id);
  }
  return packs.get(id);
}

// A text of more than one message ends with a chunk that is not full.
let chunks = '';
on('STATUSTEXT', ({ severity, text: part, id, chunk_seq }) => {
  chunks = chunk_seq ? chunks + part : part;
  if (id && part.length == CHUNK_CHARACTERS) return;
  const [, obstacle] = /^PreArm: (.*)/.exec(chunks) || [];
  if (obstacle) {
    if (!obstacles.includes(obstacle)) obstacles.push(obstacle);
    return;
  }
  const linkAge = now() - openedAt;
  if (linkAge < GREETING_MS && texts.some(({ at, text }) => text == chunks && Date.now() - at < linkAge)) return;
  const entry = { at: new Date(), severity, text: chunks };
  texts.unshift(entry);
  texts.splice(MAX_TEXTS);
  const pack = /^Battery (\d)/.exec(chunks);
  if (pack && packs.has(pack[1] - 1)) packs.get(pack[1] - 1).text = entry;
  if (severity < 5) say(chunks);
  emit('text', entry);
});

// As on the board's label; undefined if it is unknown.
const boardId = () => (version?.uid || undefined)?.toString(16).toUpperCase();

on('opened', () => {
  isIdentified = 0;
  for (const pack of allPacks()) pack.SIGMA = pack.USABL = null;
});

// For another rover the page starts again, without the key. One without an id is the same.
let knownId;
on('AUTOPILOT_VERSION', (fields) => {
  version = fields;
  const id = boardId();
  if (id && (knownId ||= id) != id) return location.reload();
  if (isIdentified) return;
  isIdentified = 1;
  ask('COMMAND_LONG', { command: SET_INTERVAL, param1: MESSAGES['NAMED_VALUE_FLOAT'].id, param2: ESTIMATES_US });
  readParameters();
});

const after = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// The next message of this name that fits; undefined if none comes in time.
function next(name, fits = () => 1, ms = SECOND) {
  return new Promise((resolve) => {
    const end = (fields) => {
      clearTimeout(timer);
      off(name, take);
      resolve(fields);
    };
    const take = (fields) => fits(fields) && end(fields);
    const timer = setTimeout(end, ms);
    on(name, take);
  });
}

const request = (name, param2) => ask('COMMAND_LONG', { command: REQUEST_MESSAGE, param1: MESSAGES[name].id, param2 });

on('PARAM_VALUE', (fields) => {
  const { param_id, param_index, param_count } = fields;
  if (paramCount && paramCount != param_count) readParameters();
  paramCount = param_count;
  // What another station has set comes without its index.
  if (param_index != UNKNOWN) listed.set(param_id, param_index);
  else if (!params.has(param_id)) return;
  params.set(param_id, fields);
  emit('param', param_id);
});

// The rover's own words, if it has said any since, say best why not.
const inItsWords = (why, before) => (why && texts[0] != before ? texts[0].text.replace(/^Arm: /, '') : why);

// How often Stop was wanted: what was begun before is not sent again.
let stops = 0;

// Sends it up to three times until it is answered. Why it was not obeyed, or nothing. Disarm goes to any rover, and on after Stop.
async function exchange(name, values, fits) {
  const run = stops;
  const [before] = texts;
  let found;
  for (let tries = 3; !found && tries; tries--) {
    const answer = next('any', fits);
    if ((isKnown() && run == stops) || values.command == ARM) ask(name, values);
    found = await answer;
  }
  if (found && !found.result && !found.error) return '';
  // The valid range of a parameter comes as a text of its own.
  await after(300);
  return inItsWords(found ? REFUSED : NO_ANSWER, before);
}

const command = (number, param1) => exchange('COMMAND_LONG', { command: number, param1 }, (answer) => answer.command == number);

// What another station sets is no answer; whole numbers are rounded.
function setParameter(name, wanted) {
  const param_type = params.get(name)?.param_type || REAL32;
  const isStored = (stored) => (param_type == REAL32 ? stored == Math.fround(wanted) : Math.abs(stored - wanted) < 1);
  return exchange('PARAM_SET', { param_id: name, param_value: wanted, param_type },
    ({ param_id, error, param_value }) => param_id == name && (error || isStored(param_value)));
}

// Reads the list, then by index what was missed. What was known stays until the list is whole.
let listing = 0;
// Index of each parameter that has come since the list began.
const listed = new Map();
async function readParameters() {
  const run = ++listing;
  listed.clear();
  paramCount = 0;
  ask('PARAM_REQUEST_LIST');
  while (run == listing && isOpen()) {
    if (await next('PARAM_VALUE', undefined, 1500)) continue;
    if (!paramCount) ask('PARAM_REQUEST_LIST');
    const read = new Set(listed.values());
    const missing = [...Array(paramCount).keys()].filter((index) => !read.has(index));
    if (paramCount && !missing.length) {
      for (const name of params.keys()) listed.has(name) || params.delete(name);
      return emit('params');
    }
    for (const param_index of missing.slice(0, 10)) ask('PARAM_REQUEST_READ', { param_index });
  }
}

// Why it would not arm is asked for as long as it would not.
function askObstacles() {
  if (ready != false || armed || !isFresh() || document.hidden) return;
  obstacles = [];
  command(CHECK_ARMING);
}
setInterval(askObstacles, 5 * SECOND);
