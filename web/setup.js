// The room of the settings: what most packs need, then all parameters.

// Voltages under load of a cell that is low and critical, by BATT_CHEM.
const CELL_VOLTS = { 1: [3.5, 3.4], 2: [3, 2.8], 3: [3.3, 3], 4: [1.1, 1] };

// Kinds of sensor that most rovers have.
const COMMON_KINDS = [3, 4, 21, 9, 7];

// What most look for first in the list of all parameters.
const USES = ['BATT', 'FS', 'ARMING', 'MOT', 'WIFI', 'SIGN', 'LOG', 'RC'];

const FORMS = {
  pack: ['MONITOR', 'CHEM', 'CELLS', 'CAPACITY'],
  thresholds: ['LOW_VOLT', 'CRT_VOLT', 'LOW_TIMER', 'FS_LOW_ACT', 'FS_CRT_ACT', 'ARM_VOLT'],
  sensor: ['CURR_PIN', 'AMP_PERVLT', 'AMP_OFFSET', 'SHUNT'],
};

// What is measured, the factor that scales it, and what measures it better.
const CALIBRATIONS = {
  voltage: ['volts', 'VOLT_MULT', ' V', 'Your multimeter shows, in volts', 'Motors off; measure at the board’s battery connector.'],
  current: ['amps', 'AMP_PERVLT', ' A', 'Your ammeter shows, in amperes', 'Take a steady load of some amperes.'],
};

// What is shown at once of the list; a search finds the others.
const MAX_LISTED = 30;

let descriptions = new Map();
const restarts = new Set();
const undone = {};

// Those of further packs are the same, and those of all thermometers.
const described = (name) => descriptions.get(name) || descriptions.get(name.replace(/\d_/, '{n}_')) || {};

async function readDescriptions() {
  if (descriptions.size) return;
  try {
    const { parameters } = await (await fetch('/parameters.json')).json();
    descriptions = new Map(parameters.map((parameter) => [parameter.name, parameter]));
    renderForms();
  } catch {
    put('setup-state', 'No descriptions came.');
  }
}

// As short as a single-precision number is written.
const short = (number) => '' + +number.toPrecision(7);

// Sets it, and says beside it what was stored.
async function change(name, wanted, state, input = {}) {
  show(state, 'Saving…');
  const why = await setParameter(name, wanted);
  input.value = input.shown = short(value(name));
  const choice = described(name).values?.find((one) => one.value == value(name));
  // Its own refusal says so itself.
  show(state, why ? (/refused:/.test(why) ? '' : 'Failed: ') + why : 'Saved: ' + (choice?.description || input.value));
  if (!why && described(name).rebootRequired) restarts.add(name);
  if (!why && /MONITOR|TYPE|DRIVER|PROTOCOL/.test(name)) readParameters();
  renderSetup();
  return !why;
}

// A field shows what is stored, until something else is typed.
function follow(input) {
  const stored = short(value(input.name));
  if (input.value != input.shown || stored == input.shown) return;
  input.value = stored;
  if (input.value != stored) input.append(el('option', { selected: true }, stored));
  input.shown = stored;
  show(input.state, '');
}

on('param', (name) => document.getElementsByName(name).forEach(follow));

// Fields that are shown already stay, with what is typed and was answered.
function fillForm(id, names) {
  const form = $(id);
  const shown = names + descriptions.size;
  if (form.shown == shown) return;
  form.shown = shown;
  form.replaceChildren(...names.map(fieldOf));
}

// What is written elsewhere by a parameter's name is called as its field here.
const readable = (text, name) => text.replace(/[A-Z]+\d?_[A-Z\d_]+/g, (other) => {
  const label = described(other).shortDesc || described(name.replace(/_.*/, '_') + other).shortDesc;
  return label ? '“' + label + '”' : other;
});

// One parameter, to be read and changed.
function fieldOf(name) {
  const { shortDesc = name, longDesc = '', units = '', min, max, values = [], bitmask = [], readOnly, rebootRequired } = described(name);
  const state = el('output');
  const common = /MONITOR/.test(name) ? COMMON_KINDS.map((kind) => values.find((one) => one.value == kind)) : [];
  const input = values[0] && !readOnly
    ? el('select', {}, ...[...new Set([...common, ...values])].map((one) => el('option', { value: one.value }, one.description)))
    : el('input', { inputMode: 'decimal', readOnly });
  Object.assign(input, { name, state });
  input.shown = input.value;
  follow(input);
  input.onchange = () => {
    const wanted = numberIn(input);
    if (Number.isNaN(wanted)) show(state, MISREAD);
    else change(name, wanted, state, input);
  };
  const bits = bitmask.map(({ index, description }) => 2 ** index + ': ' + description);
  const details = joined([min != null && min + ' to ' + max, readOnly && 'read only', rebootRequired && 'after a restart', bits[0] && 'the sum of ' + joined(bits)]);
  return el('div', { className: 'field' },
    el('label', {}, shortDesc, input),
    el('details', {}, el('summary', {}, el('code', {}, name), ' ' + units), readable(longDesc, name) + ' ' + details), state);
}

function renderForms() {
  for (const [form, names] of Object.entries(FORMS)) {
    const known = names.map(parameterOf).filter((name) => params.has(name));
    fillForm('form-' + form, known);
    $('form-' + form).parentNode.hidden = !known[0] || (form == 'sensor' && isVoltageOnly(chosenPack()));
  }
  renderList();
  renderSetup();
}

function renderList() {
  const words = $('search').value.toUpperCase().split(' ');
  const rank = (name) => 20 * !!described(name).readOnly + 10 * (/^BATT\d_MONITOR/.test(name) && !value(name)) + (USES.findIndex((use) => name.startsWith(use)) + 9) % 9;
  const found = [...params.keys()].sort((one, other) => rank(one) - rank(other)).filter((name) => {
    const { shortDesc, longDesc } = described(name);
    const text = (name + shortDesc + longDesc).toUpperCase();
    return words.every((word) => text.includes(word));
  });
  fillForm('list', found.slice(0, MAX_LISTED));
  put('found', found.length + ' of ' + params.size + ' parameters' + (found[MAX_LISTED] ? ', the first ' + MAX_LISTED + ' shown' : ''));
}

// What suits the cells that are set or detected.
function suggestion() {
  const cells = value(parameterOf('CELLS')) || chosenPack().cellCount;
  return cells && CELL_VOLTS[value(parameterOf('CHEM'))]?.map((volts) => +(volts * cells).toFixed(2));
}

// The card of a calibration.
function startCalibration([id, [key, factor, unit, question, advice]]) {
  const card = $(id);
  card.innerHTML = `<h2>Calibrate the ${id}</h2><p>The rover measures <b class="live"></b>. ${advice}</p>`
    + `<label>${question}<input inputmode="decimal" autocomplete="off"></label><p></p><button>Calibrate</button> <button></button><output></output>`;
  const [reported, input, effect, apply, undo, state] = card.querySelectorAll('b,input,label+p,button,output');
  const wanted = () => {
    const factorNow = value(parameterOf(factor));
    const scaled = factorNow * numberIn(input) / chosenPack()[key];
    return scaled > 0 && scaled < Infinity ? +scaled.toPrecision(5) : 0;
  };
  // A voltage's new factor, if it is more than 15 % from the one in force, and from the board's own divider; on another pin than
  // that one's anything goes until the factor was set.
  const isDoubtful = () => {
    const is = short(value(parameterOf(factor)));
    const isFar = (other) => Math.abs(wanted() / other - 1) > .15;
    return id == 'voltage' && isFar(is) && (value(parameterOf('VOLT_PIN')) == 26 ? isFar(3.95) : is != 3.95);
  };
  const set = async (number) => {
    const name = parameterOf(factor);
    const before = value(name);
    if (!(await change(name, number, state))) return;
    undone[name] = number == undone[name] ? null : before;
    input.value = '';
    renderForms();
  };
  const render = () => {
    const measured = chosenPack()[key];
    const name = parameterOf(factor);
    const before = undone[name];
    const is = value(name);
    const then = wanted();
    card.hidden = is == null || (key == 'amps' && isVoltageOnly(chosenPack()));
    show(reported, measured == null ? 'nothing' : digits(measured, 2) + unit);
    apply.disabled = !then || !isKnown();
    undo.disabled = !isKnown();
    show(effect, then ? name + ' changes from ' + short(is) + ' to ' + short(then) : input.value && MISREAD);
    undo.hidden = before == null;
    show(undo, before == null ? '' : 'Undo: back to ' + short(before));
  };
  input.oninput = render;
  askTwice(apply, 'Press again for another divider', () => set(wanted()), isDoubtful);
  undo.onclick = () => set(undone[parameterOf(factor)]);
  on('setup', render);
}

function renderSetup() {
  const volts = suggestion();
  hide('suggestion', !volts || !whenLow());
  put('suggest', volts ? 'Use what suits the cells: ' + volts.map((one) => digits(one, 2) + ' V').join(', ') : '');
  put('low-line', whenLow());
  const { cellCount } = chosenPack();
  put('detected', cellCount ? 'The rover counts ' + cellCount + ' cells.' : '');
  $('restart').parentNode.hidden = !restarts.size;
  put('restarts', [...restarts].join(', '));
  if (listed.size < paramCount) put('setup-state', 'Reading parameters: ' + listed.size + ' of ' + paramCount);
  emit('setup');
}

function startSetup() {
  Object.entries(CALIBRATIONS).forEach(startCalibration);
  $('pack').onchange = renderForms;
  $('search').oninput = renderList;
  $('suggest').onclick = async () => {
    const [low, critical] = suggestion();
    const action = +$('action').value;
    // The lower one first: crossed, they would keep the rover from arming. An action that is set stays.
    const wanted = [['CRT_VOLT', critical], ['LOW_VOLT', low], ['LOW_TIMER', value(parameterOf('LOW_TIMER')) || 10]];
    const unset = ['FS_LOW_ACT', 'FS_CRT_ACT'].filter((name) => !value(parameterOf(name)));
    for (const [name, number] of [...wanted, ...unset.map((name) => [name, action])]) {
      if (!(await change(parameterOf(name), number, $('suggested')))) return renderForms();
    }
    renderForms();
    put('suggested', 'Saved. ' + whenLow());
  };
  askTwice($('restart'), 'Press again to restart', async () => {
    const why = await command(RESTART, 1);
    put('restarted', why || 'Restarting…');
    if (!why) restarts.clear();
  });
  on('params', () => {
    put('setup-state', '');
    if (!$('setup').hidden) renderForms();
  });
}
