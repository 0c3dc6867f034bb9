// The room of the packs: a card each, the plot, the rover's messages.

// Interval of BATTERY_INFO: cells are detected, and the capacity is learnt.
const INFO_MS = 10000;

// By number of the charge state: a word, and its colour.
const CHARGE_STATES = [
  ['Unknown'], ['OK', 'good'], ['Low', 'low'], ['Critical', 'bad'], ['Nearly empty', 'bad'],
  ['Failed', 'bad'], ['Unhealthy', 'bad'], ['Charging', 'info'],
];

const FIGURES = {
  volts: ['Voltage', 2, ' V'], amps: ['Current', 1, ' A'], watts: ['Power', 0, ' W'],
  drawn: ['Drawn', 0, ' mAh'], left: ['Time left'], celsius: ['Temperature', 0, ' °C'], health: ['Health', 0, ' %'],
};
const FUEL_UNITS = { amps: ' l/h', drawn: ' ml' };

// Chemistries whose voltage hardly changes.
const FLAT = [2, 4];

const CHEMISTRIES = ['', 'LiPo', 'LiFe', 'Li-ion', 'NiMH'];

// From an empty lithium cell to a full one.
const CELL_EMPTY_V = 2.8;
const CELL_RANGE_V = 1.4;

const SEVERITIES = ['Emergency', 'Alert', 'Critical', 'Error', 'Warning'];

function newCard(pack) {
  const html = '<header><h2></h2><span></span></header><p class="muted"></p><div class="charge"><b></b><small></small></div><div class="bar"><i></i></div>'
    + '<div class="figures">' + Object.values(FIGURES).map(([name]) => `<div><span>${name}</span><b></b><small></small></div>`).join('')
    + '</div><p class="muted"></p><div class="cells"></div><p class="muted"></p><p class="muted"></p>';
  const card = el('article', { className: 'card live', innerHTML: html });
  show(card.querySelector('h2'), pack.name);
  $('packs').append(card);
  $('pack').append(el('option', { value: pack.id }, pack.name));
  return card;
}

const NOT_YET = 'not known yet';

// Why something of a pack is not known.
function reason(pack, key) {
  const { prefix, volts, state, cellCount, percent } = pack;
  const hasNoCurrent = isVoltageOnly(pack);
  if (isAbsent(pack)) return state == UNHEALTHY ? 'the sensor fails' : 'no pack is connected';
  if (volts == null && /volts|watts|cells/.test(key)) return 'not measured';
  if (key == 'celsius') return 'no sensor for it';
  if (hasNoCurrent && (/amps|watts|drawn|health/.test(key) || FLAT.includes(value(prefix + 'CHEM')))) return 'no current sensor';
  if (key == 'left' && percent != null) return `after ${hasNoCurrent ? 'two minutes' : 'a minute'} of driving`;
  return key != 'percent' || cellCount || volts == null ? NOT_YET : 'set the number of cells';
}

// Nothing is known of it.
const isAbsent = ({ volts, amps, percent, drawn }) => [volts, amps, percent, drawn].every((number) => number == null);

// Cells, chemistry and capacity in a line: first what the owner has set or the pack reports, then what is assumed.
function contents(pack) {
  const { prefix, cells, cellCount, chemistry, design, full } = pack;
  const amount = (number) => digits(number) + (isTank(pack) ? ' ml' : ' mAh');
  const parts = [
    [cellCount && cellCount + (cellCount > 1 ? ' cells' : ' cell'), value(prefix + 'CELLS') == 0],
    [CHEMISTRIES[chemistry], value(prefix + 'CHEM') == 1],
    [design > 0 && amount(design), value(prefix + 'CAPACITY') == 3300],
  ].filter(([part]) => part);
  const join = (isDefault) => parts.filter((part) => (part[1] && !cells[0]) == isDefault).map(([part]) => part).join(', ');
  const assumed = join(true);
  return joined([join(false), assumed && 'assumed: ' + assumed, full > 0 && 'learnt ' + amount(full)], '; ');
}

function renderPack(pack) {
  const card = (pack.card ||= newCard(pack));
  const [, state, percent, why, bar] = card.querySelectorAll('h2,header span,.charge *,i');
  const [what, missing, low] = card.querySelectorAll('p');
  const [word, colour = ''] = CHARGE_STATES[pack.state] || CHARGE_STATES[0];
  const old = now() - pack.at;
  card.classList.toggle('old', old > DEAD_MS);
  // Why it is low, where the percentage does not show it.
  const usable = pack.USABL == null || pack.percent == null ? '' : digits(pack.USABL) + ' % usable';
  show(state, isAbsent(pack) && !pack.state ? 'Not connected' : word + (usable && isLevel(pack.state) ? ': ' + usable : ''));
  state.className = 'chip ' + colour;
  show(percent, pack.percent == null ? '–' : pack.percent + ' %');
  // Two standard deviations: it is within them 19 times of 20.
  const band = joined([pack.SIGMA != null && '± ' + digits(2 * pack.SIGMA) + ' %', usable]);
  show(why, old > FRESH_MS ? duration(old / SECOND) + ' old' : pack.percent == null ? 'Charge unknown: ' + reason(pack, 'percent') : band);
  show(what, contents(pack));
  bar.style.width = +pack.percent + '%';
  bar.className = colour;
  // Grouped by cause: values that can't be measured have no field.
  const lacks = {};
  Object.entries(FIGURES).forEach(([key, [name, places, unit]], index) => {
    const field = card.querySelectorAll('.figures>div')[index];
    const [, figure, why] = field.children;
    const number = pack[key];
    if (isTank(pack)) unit = FUEL_UNITS[key] || unit;
    const cause = number == null ? reason(pack, key) : '';
    const isTransient = cause == NOT_YET;
    field.hidden = cause && !isTransient;
    if (field.hidden) (lacks[cause] ||= []).push(name);
    show(figure, cause ? '–' : unit ? digits(number, places) + unit : number > 1 ? duration(number) : 'none');
    show(why, cause);
  });
  show(missing, Object.entries(lacks).map(([cause, names]) => names.join(', ') + ': ' + cause + '.').join(' '));
  show(low, whenLow(pack.prefix));
  const cells = card.querySelector('.cells');
  if (cells.children.length != pack.cells.length) {
    cells.replaceChildren(...pack.cells.map((_, index) => el('div', { innerHTML: `Cell ${index + 1}<div class="bar"><i></i></div><b></b>` })));
  }
  pack.cells.forEach((volts, index) => {
    const [bar, text] = cells.children[index].children;
    bar.firstChild.style.width = (volts - CELL_EMPTY_V) / CELL_RANGE_V * 100 + '%';
    show(text, digits(volts, 2) + ' V');
  });
  show(card.lastChild, pack.text ? pack.text.text + ', ' + clock(pack.text.at) : '');
}

function renderBattery() {
  const shown = allPacks();
  shown.forEach(renderPack);
  hide('pack', !shown[1]);
  if (shown[0]) drawPlot(chosenPack());
}

on('text', ({ at, severity, text }) => {
  const colour = severity < 4 ? 'bad' : severity < 5 ? 'low' : '';
  const list = $('messages');
  list.prepend(el('li', {}, el('time', {}, clock(at)), el('span', { className: colour }, SEVERITIES[severity] || ''), el('span', {}, text)));
  list.children[MAX_TEXTS]?.remove();
});

setInterval(() => {
  if (isFresh() && !document.hidden) for (const { id } of allPacks()) request('BATTERY_INFO', id);
}, INFO_MS);
