// The room of the link: its key, its losses, who is at the other end.

const versionOf = (number) => [number >>> 24, (number >> 16) & 255, (number >> 8) & 255].join('.');

function renderAbout() {
  const open = roverSigns ? 'the rover signs, this page does not' : 'open: anyone in the network may command the rover';
  const facts = {
    Signing: signer ? 'this page signs' : open,
    'Frames received': received,
    'Frames lost': lost,
    'Frames ignored, not signed': ignored,
    'Lost on the way there': system.errors_comm,
    Firmware: version && versionOf(version.middleware_sw_version) + ' ' + version.flight_custom_version,
    Board: boardId(),
    'System ids': roverSystem + ', of this page ' + ownSystem,
  };
  const rows = Object.entries(facts).map(([name, fact]) => el('div', {}, el('dt', {}, name), el('dd', {}, fact ?? 'unknown')));
  fill($('facts'), rows);
  hide('forget', !signer);
}

function startAbout() {
  $('key-form').onsubmit = (event) => {
    event.preventDefault();
    useKey(keyOf($('passphrase').value));
    emit('opened');
    $('passphrase').value = '';
    put('key-state', 'This page signs.');
  };
  $('forget').onclick = () => {
    useKey();
    put('key-state', 'This page does not sign.');
  };
}
