// The room of the packs: a card each, the plot, the rover's messages.

// By number of the charge state: a word, and its colour.
const CHARGE_STATES = [
  ['Unknown', ''], ['OK', 'good'], ['Low', 'low'], ['Critical', 'bad'], ['Nearly empty', 'bad'],
  ['Failed', 'bad'], ['Unhealthy', 'bad'], ['Charging', 'charging'],
];

// Kinds of pack that have a voltage only.
const VOLTAGE_ONLY = [3, 6];
const STALE_PACK_MS = 5000;

const cards = new Map();

function newCard(pack) {
  const figure = (name) => {
    const parts = { value: el('b'), why: el('small') };
    return [parts, el('div', { className: 'figure' }, el('span', {}, name), parts.value, parts.why)];
  };
  const card = { figures: {}, state: el('span'), percent: el('b'), why: el('small'), bar: el('i'), cells: el('div', { className: 'cells' }), text: el('p', { className: 'muted' }) };
  const figures = el('div', { className: 'figures' });
  for (const [key, name] of Object.entries({ volts: 'Voltage', amps: 'Current', watts: 'Power', drawn: 'Drawn', left: 'Time left', celsius: 'Temperature' })) {
    const [parts, element] = figure(name);
    card.figures[key] = parts;
    figures.append(element);
  }
  card.element = el('article', { className: 'card pack live' },
    el('header', {}, el('h2', {}, pack.name), card.state),
    el('div', { className: 'charge' }, card.percent, card.why),
    el('div', { className: 'bar', ariaHidden: 'true' }, card.bar),
    figures, card.cells, card.text);
  $('packs').append(card.element);
  $('plotted-pack').append(el('option', { value: pack.id }, pack.name));
  return card;
}

// Why something of a pack is not known.
function reason(pack, key) {
  const kind = value(pack.prefix + 'MONITOR');
  if (pack.volts == null && pack.state != 6) return 'no pack is connected';
  if (key == 'volts') return 'the sensor fails';
  if (key == 'celsius') return 'no sensor for it';
  const hasNoCurrent = VOLTAGE_ONLY.includes(kind);
  if (key != 'percent') {
    if (hasNoCurrent) return 'no current sensor';
    return key == 'left' ? 'not known yet' : 'not measured';
  }
  if (hasNoCurrent && [2, 4].includes(value(pack.prefix + 'CHEM'))) return 'the voltage hardly tells: it needs a current sensor';
  return pack.cellCount ? 'not known yet' : 'the number of cells is not clear: set it under Set up';
}

function renderPack(pack) {
  if (!cards.has(pack.id)) cards.set(pack.id, newCard(pack));
  const card = cards.get(pack.id);
  const [word, colour] = CHARGE_STATES[pack.state] || CHARGE_STATES[0];
  const age = performance.now() - pack.at;
  card.element.classList.toggle('old', age > STALE_PACK_MS || !link.isFresh);
  show(card.state, pack.volts == null && !pack.state ? 'Not connected' : word);
  card.state.className = 'chip ' + colour;
  show(card.percent, pack.percent == null ? '–' : pack.percent + ' %');
  show(card.why, pack.percent == null ? 'Charge unknown: ' + reason(pack, 'percent') : age > FRESH_MS ? duration(age / 1000) + ' old' : '');
  card.bar.style.width = (pack.percent || 0) + '%';
  card.bar.className = colour;
  const watts = pack.volts == null || pack.amps == null ? null : pack.volts * pack.amps;
  const shown = {
    volts: [pack.volts, 2, 'V'], amps: [pack.amps, 1, 'A'], watts: [watts, 0, 'W'],
    drawn: [pack.drawn, 0, 'mAh'], celsius: [pack.celsius, 0, '°C'],
  };
  for (const [key, parts] of Object.entries(card.figures)) {
    const [number, places, unit] = shown[key] || [pack.left];
    show(parts.value, number == null ? '–' : key == 'left' ? duration(number) : digits(number, places) + ' ' + unit);
    show(parts.why, number == null ? reason(pack, key) : '');
  }
  renderCells(card, pack);
  const { text } = pack;
  show(card.text, text ? text.text + ', ' + clock(text.at) : '');
}

function renderCells({ cells }, pack) {
  const count = pack.cells.length;
  while (cells.children.length > count) cells.lastChild.remove();
  while (cells.children.length < count) {
    cells.append(el('div', {}, el('span', {}, 'Cell ' + (cells.children.length + 1)), el('div', { className: 'bar' }, el('i')), el('b')));
  }
  // From an empty lithium cell to a full one.
  pack.cells.forEach((volts, index) => {
    const [, bar, text] = cells.children[index].children;
    bar.firstChild.style.width = Math.max(2, Math.min(100, (volts - 2.8) / 1.4 * 100)) + '%';
    show(text, digits(volts, 2) + ' V');
  });
}

// What keeps the rover from driving, in its own words.
function notices() {
  const found = [];
  const latest = (pattern) => rover.texts.find(({ text }) => pattern.test(text))?.text;
  if (link.roverSigns && !link.signer) {
    found.push('This rover has a signing key: it obeys this page once you enter the passphrase under Link.');
  } else if (link.signer && link.ignored && performance.now() - link.heartbeatAt > FRESH_MS && link.isOpen) {
    found.push('Nothing comes that is signed with your key: a wrong passphrase, or a rover without a key. See Link.');
  }
  if (rover.status == STATE_TERMINATED) found.push(latest(/^Terminated/) || 'Terminated: reset the battery or restart');
  if (rover.status == STATE_TIMED_OUT) found.push(latest(/Failsafe: Hold$/) || 'Failsafe: Hold');
  if (rover.ready == false && !rover.armed) {
    found.push(...(rover.obstacles.length ? rover.obstacles.map((text) => 'Does not arm: ' + text) : ['Not ready to arm']));
  }
  return found;
}

function renderNotices() {
  const found = link.isFresh || link.ignored ? notices() : [];
  for (const list of document.querySelectorAll('.notices')) {
    if (list.textContent == found.join('')) continue;
    list.replaceChildren(...found.map((text) => el('li', {}, text)));
  }
}

function renderBattery() {
  for (const pack of rover.packs.values()) if (pack.at) renderPack(pack);
  $('no-pack').hidden = cards.size > 0;
  $('history').hidden = !cards.size;
  $('plotted-pack').parentNode.hidden = cards.size < 2;
  if (!$('battery').hidden) drawPlot(rover.packs.get(+$('plotted-pack').value));
}

function startBattery() {
  startPlot();
  on('text', ({ at, severity, text }) => {
    const kind = severity < 4 ? 'bad' : severity == 4 ? 'low' : '';
    $('messages').prepend(el('li', {}, el('time', {}, clock(at)), el('span', { className: kind }, SEVERITIES[severity] || ''), el('span', {}, text)));
    while ($('messages').children.length > MAX_TEXTS) $('messages').lastChild.remove();
  });
}
