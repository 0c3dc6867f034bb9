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
  drawn: ['Drawn', 0, ' mAh'], left: ['Time left'], celsius: ['Temperature', 0, ' °C'],
};

// Chemistries whose voltage hardly changes.
const FLAT = [2, 4];

const CHEMISTRIES = ['', 'LiPo', 'LiFe', 'Li-ion', 'NiMH'];

// From an empty lithium cell to a full one.
const CELL_EMPTY_V = 2.8;
const CELL_RANGE_V = 1.4;

const SEVERITIES = ['Emergency', 'Alert', 'Critical', 'Error', 'Warning', 'Notice', 'Info', 'Debug'];

function newCard(pack) {
  const html = '<header><h2></h2><span></span></header><p class="muted"></p><div class="charge"><b></b><small></small></div><div class="bar"><i></i></div>'
    + '<div class="figures">' + Object.values(FIGURES).map(([name]) => `<div><span>${name}</span><b></b><small></small></div>`).join('')
    + '</div><p class="muted"></p><div class="cells"></div><p class="muted"></p>';
  const card = el('article', { className: 'card live', innerHTML: html });
  show(card.querySelector('h2'), pack.name);
  $('packs').append(card);
  $('pack').append(el('option', { value: pack.id }, pack.name));
  return card;
}

const NOT_YET = 'not known yet';

// Why something of a pack is not known.
function reason(pack, key) {
  const { prefix, volts, state, cellCount } = pack;
  const hasNoCurrent = isVoltageOnly(pack);
  if (volts == null) return state == UNHEALTHY ? 'the sensor fails' : 'no pack is connected';
  if (key == 'celsius') return 'no sensor for it';
  if (hasNoCurrent && (key != 'percent' || FLAT.includes(value(prefix + 'CHEM')))) return 'no current sensor';
  return key != 'percent' || cellCount ? NOT_YET : 'set the number of cells';
}

// Cells, chemistry and capacity, in a line.
function contents({ cellCount, chemistry, design, full }) {
  const mah = (ampHours) => digits(ampHours * 1000) + ' mAh';
  const cells = cellCount && cellCount + (cellCount > 1 ? ' cells' : ' cell');
  return [cells, CHEMISTRIES[chemistry], design > 0 && mah(design), full > 0 && 'learnt ' + mah(full)].filter((part) => part).join(', ');
}

function renderPack(pack) {
  const card = (pack.card ||= newCard(pack));
  const [, state, percent, why, bar] = card.querySelectorAll('h2,header span,.charge *,i');
  const [what, missing] = card.querySelectorAll('p');
  const [word, colour = ''] = CHARGE_STATES[pack.state] || CHARGE_STATES[0];
  const old = now() - pack.at;
  card.classList.toggle('old', old > DEAD_MS);
  show(state, pack.volts == null && !pack.state ? 'Not connected' : word);
  state.className = 'chip ' + colour;
  show(percent, pack.percent == null ? '–' : pack.percent + ' %');
  // Two standard deviations: it is within them 19 times of 20.
  const band = pack.deviation == null ? '' : '± ' + digits(2 * pack.deviation) + ' %';
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
    const cause = number == null ? reason(pack, key) : '';
    const isTransient = cause == NOT_YET;
    field.hidden = cause && !isTransient;
    if (field.hidden) (lacks[cause] ||= []).push(name);
    show(figure, cause ? '–' : unit ? digits(number, places) + unit : duration(number));
    show(why, cause);
  });
  show(missing, Object.entries(lacks).map(([cause, names]) => names.join(', ') + ': ' + cause + '.').join(' '));
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
  list.prepend(el('li', {}, el('time', {}, clock(at)), el('span', { className: colour }, SEVERITIES[severity]), el('span', {}, text)));
  list.children[MAX_TEXTS]?.remove();
});

setInterval(() => {
  if (isFresh() && !document.hidden) for (const { id } of allPacks()) request('BATTERY_INFO', id);
}, INFO_MS);
