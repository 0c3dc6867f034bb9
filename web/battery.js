// The room of the packs: a card each, the plot, the rover's messages.

// By number of the charge state: a word, and its colour.
const CHARGE_STATES = [
  ['Unknown'], ['OK', 'good'], ['Low', 'low'], ['Critical', 'bad'], ['Nearly empty', 'bad'],
  ['Failed', 'bad'], ['Unhealthy', 'bad'], ['Charging', 'info'],
];
const UNHEALTHY = 6;

const FIGURES = {
  volts: ['Voltage', 2, ' V'], amps: ['Current', 1, ' A'], watts: ['Power', 0, ' W'],
  drawn: ['Drawn', 0, ' mAh'], left: ['Time left'], celsius: ['Temperature', 0, ' °C'],
};

// Kinds of pack that have a voltage only, and chemistries whose voltage hardly changes.
const VOLTAGE_ONLY = [3, 6];
const FLAT = [2, 4];

// From an empty lithium cell to a full one.
const CELL_EMPTY_V = 2.8;
const CELL_RANGE_V = 1.4;

const SEVERITIES = ['Emergency', 'Alert', 'Critical', 'Error', 'Warning', 'Notice', 'Info', 'Debug'];

function newCard(pack) {
  const html = '<header><h2></h2><span></span></header><div class="charge"><b></b><small></small></div><div class="bar"><i></i></div>'
    + '<div class="figures">' + Object.values(FIGURES).map(([name]) => `<div><span>${name}</span><b></b><small></small></div>`).join('')
    + '</div><div class="cells"></div><p class="muted"></p>';
  const card = el('article', { className: 'card live', innerHTML: html });
  show(card.querySelector('h2'), pack.name);
  $('packs').append(card);
  $('pack').append(el('option', { value: pack.id }, pack.name));
  return card;
}

// Why something of a pack is not known.
function reason({ prefix, volts, state, cellCount }, key) {
  const hasNoCurrent = VOLTAGE_ONLY.includes(value(prefix + 'MONITOR'));
  if (volts == null) return state == UNHEALTHY ? 'the sensor fails' : 'no pack is connected';
  if (key == 'celsius') return 'no sensor for it';
  if (key != 'percent') return hasNoCurrent ? 'no current sensor' : 'not known yet';
  if (hasNoCurrent && FLAT.includes(value(prefix + 'CHEM'))) return 'no current sensor';
  return cellCount ? 'not known yet' : 'set the number of cells';
}

function renderPack(pack) {
  const card = (pack.card ||= newCard(pack));
  const [, state, percent, why, bar] = card.querySelectorAll('h2,header span,.charge *,i');
  const [word, colour = ''] = CHARGE_STATES[pack.state] || CHARGE_STATES[0];
  const old = now() - pack.at;
  card.classList.toggle('old', old > DEAD_MS);
  show(state, pack.volts == null && !pack.state ? 'Not connected' : word);
  state.className = 'chip ' + colour;
  show(percent, pack.percent == null ? '–' : pack.percent + ' %');
  const unknown = pack.percent == null ? 'Charge unknown: ' + reason(pack, 'percent') : '';
  show(why, old > FRESH_MS ? duration(old / SECOND) + ' old' : unknown);
  bar.style.width = +pack.percent + '%';
  bar.className = colour;
  Object.entries(FIGURES).forEach(([key, [, places, unit]], index) => {
    const [, figure, why] = card.querySelectorAll('.figures>div')[index].children;
    const number = pack[key];
    show(figure, number == null ? '–' : unit ? digits(number, places) + unit : duration(number));
    show(why, number == null ? reason(pack, key) : '');
  });
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

// What keeps the rover from driving, in its own words.
function notices() {
  const found = [];
  if (lacksKey()) found.push('The rover has a signing key: enter it under Link.');
  if (ignored && age() > FRESH_MS) found.push('Nothing comes that is signed with your key: it is wrong, or the rover has none.');
  if (!isFresh()) return found;
  if (status == STATE_TERMINATED) found.push(textLike(/^Terminated/) || 'Terminated');
  if (status == STATE_TIMED_OUT) found.push(textLike(/Failsafe: Hold$/) || 'Failsafe: Hold');
  if (ready == false && !armed) found.push(...(obstacles[0] ? obstacles : ['not ready']).map((text) => 'Does not arm: ' + text));
  return found;
}

function renderNotices() {
  const found = notices();
  for (const list of document.querySelectorAll('.notices')) {
    fill(list, found.map((text) => el('li', {}, text, / 1$/.test(text) ? el('button', { onclick: () => setParameter('PARAM_CHECKED', 1) }, 'Set') : '')));
  }
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
