// The room of the settings: what most packs need, then all parameters.

// Voltages under load of a cell that is low and critical, by BATT_CHEM.
const CELL_VOLTS = { 1: [3.5, 3.4], 2: [3.0, 2.8], 3: [3.3, 3.0], 4: [1.1, 1.0] };

const FORMS = {
  pack: ['MONITOR', 'CHEM', 'CELLS', 'CAPACITY'],
  thresholds: ['LOW_VOLT', 'CRT_VOLT', 'LOW_TIMER', 'FS_LOW_ACT', 'FS_CRT_ACT', 'ARM_VOLT'],
  sensor: ['CURR_PIN', 'AMP_PERVLT', 'AMP_OFFSET', 'SHUNT'],
};

// What is shown at once of the list; a search finds the others.
const MAX_LISTED = 30;

let descriptions = null;
const restarts = new Set();

// The description of a parameter; those of further packs are the same.
function described(name) {
  if (!descriptions) return {};
  return descriptions.get(name) || descriptions.get(name.replace(/^BATT\d_/, 'BATT{n}_')) || {};
}

async function readDescriptions() {
  if (descriptions) return;
  try {
    const { parameters } = await (await fetch('/parameters.json')).json();
    descriptions = new Map(parameters.map((parameter) => [parameter.name, parameter]));
    renderForms();
  } catch {
    show($('setup-state'), 'No descriptions: the rover did not send them.');
  }
}

// A parameter's value as short as a single-precision number is written.
const short = (number) => String(+number.toPrecision(7));

// One parameter, to be read and changed.
function fieldOf(name) {
  const { shortDesc, longDesc = '', units = '', min, max, values, bitmask, readOnly, rebootRequired } = described(name);
  const id = 'field-' + Math.random().toString(36).slice(2);
  const state = el('small', { className: 'answer', role: 'status' });
  const now = value(name);
  const input = values && !readOnly
    ? el('select', { id }, ...values.map((one) => el('option', { value: one.value }, one.description)))
    : el('input', { id, inputMode: 'decimal', autocomplete: 'off', readOnly: !!readOnly });
  if (values && !readOnly && !values.some((one) => one.value == now)) input.append(el('option', { value: now }, short(now)));
  input.value = short(now);
  input.dataset.param = name;
  input.onchange = async () => {
    const wanted = Number(input.value.replace(',', '.').replace('−', '-'));
    if (!input.value.trim() || Number.isNaN(wanted)) return show(state, 'Not a number');
    show(state, 'Saving…');
    const why = await setParameter(name, wanted);
    show(state, why ? 'Refused: ' + why : 'Saved');
    state.classList.toggle('bad', !!why);
    if (why) input.value = short(value(name));
    else if (rebootRequired) restarts.add(name);
    if (!why && /MONITOR|_TYPE|DRIVER|PROTOCOL/.test(name)) readParameters();
    renderSetup();
  };
  const range = min != null && max != null && max - min < 1e9 ? min + ' to ' + max + (units ? ' ' + units : '') : units;
  const bits = bitmask ? 'The sum of ' + bitmask.map((bit) => 2 ** bit.index + ' (' + bit.description + ')').join(', ') : '';
  const details = [range, readOnly ? 'read only' : '', rebootRequired ? 'after a restart' : ''].filter((part) => part).join(', ');
  return el('div', { className: 'field' },
    el('label', { htmlFor: id }, shortDesc || name, el('code', {}, name)),
    el('div', {}, input, el('small', {}, details)),
    el('p', {}, longDesc + ' ' + bits), state);
}

const prefix = () => rover.packs.get(+$('setup-pack').value)?.prefix || 'BATT_';
const packOfPrefix = () => [...rover.packs.values()].find((pack) => pack.prefix == prefix()) || {};

function renderForms() {
  for (const [form, names] of Object.entries(FORMS)) {
    const known = names.map((name) => prefix() + name).filter((name) => rover.params.has(name));
    $('form-' + form).replaceChildren(...known.map(fieldOf));
    $('form-' + form).closest('.card').hidden = !known.length;
  }
  renderList();
  renderSetup();
}

function renderList() {
  const words = $('search').value.toUpperCase().split(/\s+/).filter((word) => word);
  const found = [...rover.params.keys()].sort().filter((name) => {
    const { shortDesc = '', longDesc = '' } = described(name);
    const text = (name + ' ' + shortDesc + ' ' + longDesc).toUpperCase();
    return words.every((word) => text.includes(word));
  });
  $('list').replaceChildren(...found.slice(0, MAX_LISTED).map(fieldOf));
  const more = found.length - MAX_LISTED;
  show($('found'), found.length + ' of ' + rover.params.size + ' parameters' + (more > 0 ? ', the first ' + MAX_LISTED + ' shown' : ''));
}

// What is suggested for the cells that are set or detected.
function suggestion() {
  const cells = value(prefix() + 'CELLS') || packOfPrefix().cellCount;
  const volts = CELL_VOLTS[value(prefix() + 'CHEM')];
  return cells && volts ? volts.map((one) => +(one * cells).toFixed(2)) : null;
}

// Calibrations, each with what is measured here, and the factor that scales it.
const CALIBRATIONS = {
  voltage: { key: 'volts', factor: 'VOLT_MULT', unit: 'V', places: 2 },
  current: { key: 'amps', factor: 'AMP_PERVLT', unit: 'A', places: 2 },
};

const undone = new Map();

function newFactor({ key, factor }, input) {
  const reported = packOfPrefix()[key];
  const measured = Number(input.value.replace(',', '.'));
  const now = value(prefix() + factor);
  return reported && measured > 0 && now != null ? +(now * measured / reported).toPrecision(5) : null;
}

function renderCalibration(name) {
  const calibration = CALIBRATIONS[name];
  const { key, factor, unit, places } = calibration;
  const reported = packOfPrefix()[key];
  const now = value(prefix() + factor);
  const changed = newFactor(calibration, $('measured-' + name));
  $('calibrate-' + name).closest('.card').hidden = now == null;
  show($('reported-' + name), reported == null ? 'unknown' : digits(reported, places) + ' ' + unit);
  $('calibrate-' + name).disabled = changed == null || !link.isFresh;
  const far = changed && Math.abs(changed / now - 1) > 0.2 ? ' That is far off: check the meter, and ' + (key == 'volts' ? 'the pin.' : 'the sensor.') : '';
  show($('change-' + name), changed == null ? '' : prefix() + factor + ' changes from ' + short(now) + ' to ' + short(changed) + '.' + far);
  const before = undone.get(prefix() + factor);
  $('undo-' + name).hidden = before == null;
  if (before != null) show($('undo-' + name), 'Undo: back to ' + short(before));
}

function startCalibration(name) {
  const calibration = CALIBRATIONS[name];
  const set = async (parameter, wanted, done) => {
    const why = await setParameter(parameter, wanted);
    show($('calibrated-' + name), why ? 'Refused: ' + why : done);
    if (!why) $('measured-' + name).value = '';
    renderForms();
    return !why;
  };
  $('measured-' + name).oninput = () => renderCalibration(name);
  $('calibrate-' + name).onclick = async () => {
    const parameter = prefix() + calibration.factor;
    const before = value(parameter);
    const wanted = newFactor(calibration, $('measured-' + name));
    if (await set(parameter, wanted, 'Calibrated: ' + parameter + ' is ' + short(wanted))) undone.set(parameter, before);
    renderCalibration(name);
  };
  $('undo-' + name).onclick = async () => {
    const parameter = prefix() + calibration.factor;
    const before = undone.get(parameter);
    if (await set(parameter, before, 'As before: ' + short(before))) undone.delete(parameter);
    renderCalibration(name);
  };
}

function renderSetup() {
  const packs = [...rover.packs.values()];
  if ($('setup-pack').children.length != packs.length) {
    $('setup-pack').replaceChildren(...packs.map((pack) => el('option', { value: pack.id }, pack.name)));
  }
  $('setup-pack').parentNode.hidden = packs.length < 2;
  Object.keys(CALIBRATIONS).forEach(renderCalibration);
  const volts = suggestion();
  $('suggest').hidden = !volts;
  if (volts) show($('suggest'), 'Use what suits the cells: ' + volts.map((one) => digits(one, 2) + ' V').join(' and '));
  const detected = packOfPrefix().cellCount;
  show($('detected'), detected ? 'The rover counts ' + detected + ' cells.' : '');
  $('restart').closest('.card').hidden = !restarts.size;
  show($('restarts'), [...restarts].join(', '));
  const read = rover.params.size;
  if (read < rover.paramCount) show($('setup-state'), 'Reading parameters: ' + read + ' of ' + rover.paramCount);
}

function startSetup() {
  Object.keys(CALIBRATIONS).forEach(startCalibration);
  $('setup-pack').onchange = renderForms;
  $('search').oninput = renderList;
  $('suggest').onclick = async () => {
    const [low, critical] = suggestion();
    const why = (await setParameter(prefix() + 'CRT_VOLT', critical)) || (await setParameter(prefix() + 'LOW_VOLT', low));
    renderForms();
    show($('suggested'), why ? 'Refused: ' + why : 'Saved');
  };
  askTwice($('restart'), 'Restart now? Press again', async () => {
    const result = await command(RESTART, 1);
    show($('restarted'), result == ACCEPTED ? 'Restarting…' : 'Not restarted: ' + because(result));
    if (result == ACCEPTED) restarts.clear();
  });
  on('params', () => {
    show($('setup-state'), '');
    renderForms();
  });
}
