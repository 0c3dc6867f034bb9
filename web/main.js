// The rooms, the strip above them, and when what is drawn.

const ROOMS = ['battery', 'drive', 'setup', 'logs', 'about'];

let wasFresh = false;
let refusal = '';

function enter() {
  const room = ROOMS.find((name) => '#' + name == location.hash) || ROOMS[0];
  if (drives) letGo();
  ROOMS.forEach((name, index) => {
    hide(name, name != room);
    document.querySelectorAll('nav a')[index].ariaCurrent = name == room && 'page';
  });
  if (room == 'setup') {
    readDescriptions();
    renderForms();
  }
  if (room == 'logs') listLogs();
  render();
}

function render() {
  const fresh = isFresh();
  if (wasFresh != fresh) say(fresh ? 'Connected' : 'Connection lost');
  wasFresh = fresh;
  document.body.className = fresh ? '' : 'stale';
  const seen = age() < Infinity ? 'Not heard for ' + duration(age() / SECOND) : 'Connecting…';
  put('freshness', fresh ? 'Live' : seen);
  put('refused', fresh ? '' : refusal);
  put('armed', armed == null ? '' : armed ? 'Armed' : 'Disarmed');
  $('armed').className = armed ? 'chip info' : 'chip';
  put('mode', armed == null ? '' : MODES[mode] || 'Mode ' + mode);
  const { percent, volts } = chosenPack();
  put('charge', (percent == null ? '' : percent + ' %  ') + (volts == null ? '' : digits(volts, 1) + ' V'));
  hide('while-armed', !armed);
  renderNotices();
  renderBattery();
  renderDrive();
  if (!$('setup').hidden) renderSetup();
  if (!$('about').hidden) renderAbout();
}

// A WebSocket does not say why it was refused. If the page itself comes, the places are taken.
on('closed', async (wasOpen) => {
  render();
  if (wasOpen) return;
  refusal = await fetch('/', { cache: 'no-cache' }).then(() => 'No place: two browsers are connected already?', () => '');
});
on('state', render);
// A new one at once.
on('pack', (pack) => pack.card || render());

startPlot();
startDrive();
startSetup();
startLogs();
startAbout();
onhashchange = enter;
enter();
startLink();
setInterval(render, 250);
