// The room of the link: its key, its losses, who is at the other end.

const hex = (number, count) => number.toString(16).toUpperCase().padStart(count, '0');

function versionOf(number) {
  return [number >>> 24, (number >> 16) & 255, (number >> 8) & 255].join('.');
}

function facts() {
  const { version } = rover;
  const share = link.received ? link.lost / (link.received + link.lost) * 100 : 0;
  const signed = link.roverSigns ? (link.signer ? 'signed both ways' : 'the rover signs, this page does not') : link.signer ? 'this page signs, the rover does not' : 'open: anyone in its network may command the rover';
  return {
    Link: signed,
    Address: location.host,
    'Frames received': link.received,
    'Frames lost': link.lost + ' (' + digits(share, 1) + ' %)',
    'Ignored, not signed with the key': link.ignored,
    'Lost on the way to the rover': rover.errors ?? 'unknown',
    'Load of the board': digits(rover.load / 10, 0) + ' %',
    Firmware: version ? versionOf(version.middleware_sw_version) + ', parameters as ArduPilot ' + versionOf(version.flight_sw_version) : 'unknown',
    Program: version?.flight_custom_version || 'unknown',
    Board: version?.uid ? hex(version.uid, 16) : 'unknown',
    'System of the rover': link.rover.system,
    'System of this page': link.system,
  };
}

function renderAbout() {
  const list = $('facts');
  for (const [name, fact] of Object.entries(facts())) {
    let row = list.querySelector(`[data-fact="${name}"]`);
    if (!row) {
      row = el('div', {}, el('dt', {}, name), el('dd'));
      row.dataset.fact = name;
      list.append(row);
    }
    show(row.lastChild, String(fact));
  }
  $('forget').hidden = !link.signer;
}

function startAbout() {
  $('key-form').onsubmit = (event) => {
    event.preventDefault();
    link.use(keyOf($('passphrase').value));
    $('passphrase').value = '';
    show($('key-state'), 'This page signs now, until its tab is closed.');
  };
  $('forget').onclick = () => {
    link.use(null);
    show($('key-state'), 'Forgotten: this page does not sign.');
  };
}
